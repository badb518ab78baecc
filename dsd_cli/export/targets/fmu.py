"""FMI 2.0 for co-simulation: a source FMU, C and its description alone; the tool that imports it compiles it."""

from __future__ import annotations

import hashlib
import io
import zipfile
from pathlib import Path

import numpy as np

from dsd_cli.errors import DataError, how_to_install
from dsd_cli.export.base import Joint, Motion, NotRun, Target, comment, finite, number
from dsd_cli.export.c_text import header
from dsd_cli.export.computing import judge, scratch, shared_library
from dsd_cli.signals.log import Array

#: The one date that the archive has: the same joint gives the same bytes.
_DATE = (1980, 1, 1, 0, 0, 0)

_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{guid}" description="{title}"
 generationTool="dsd" variableNamingConvention="structured" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="false">
    <SourceFiles>
      <File name="fmu.c"/>
    </SourceFiles>
  </CoSimulation>
  <DefaultExperiment startTime="0.0" stepSize="{clock}"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="discrete" description="command">
      <Real start="0.0"/>
    </ScalarVariable>
    <ScalarVariable name="velocity" valueReference="1" causality="output" variability="discrete" initial="calculated"
     description="speed of the axis">
      <Real/>
    </ScalarVariable>
    <ScalarVariable name="position" valueReference="2" causality="output" variability="discrete" initial="calculated"
     description="position of the axis">
      <Real/>
    </ScalarVariable>
    <ScalarVariable name="velocity_start" valueReference="3" causality="parameter" variability="fixed" initial="exact">
      <Real start="0.0"/>
    </ScalarVariable>
    <ScalarVariable name="position_start" valueReference="4" causality="parameter" variability="fixed" initial="exact">
      <Real start="0.0"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs>
      <Unknown index="2" dependencies=""/>
      <Unknown index="3" dependencies=""/>
    </Outputs>
    <InitialUnknowns>
      <Unknown index="2" dependencies="4"/>
      <Unknown index="3" dependencies="5"/>
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""

_SOURCE = """/* FMI 2.0 co-simulation of joint.h: u is held from tick to tick of its clock, {clock} s */
#include <stdlib.h>
#include <string.h>
#include "joint.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* fmi2TypesPlatform.h and fmi2FunctionTypes.h, as far as they are needed */
typedef void *Component;
typedef const char *String;
typedef int Boolean;
typedef unsigned int Reference;
typedef enum {{ OK, Warning, Discard, Error, Fatal, Pending }} Status;
typedef enum {{ ModelExchange, CoSimulation }} Type;
typedef struct {{
    void (*logger)(void *, String, Status, String, String, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, Status);
    void *environment;
}} Callbacks;

typedef struct {{ {name}_plant axis; double u, velocity, position, time, start; int ready; Callbacks calls; }} Instance;

EXPORT String fmi2GetTypesPlatform(void) {{ return "default"; }}
EXPORT String fmi2GetVersion(void) {{ return "2.0"; }}

EXPORT Component fmi2Instantiate(String name, Type type, String guid, String resources, const Callbacks *calls,
                                 Boolean visible, Boolean logging)
{{
    Instance *c;
    (void)name, (void)resources, (void)visible, (void)logging;
    if (type != CoSimulation || !guid || strcmp(guid, "{guid}") || !calls) return NULL;
    c = calls->allocate ? calls->allocate(1, sizeof *c) : calloc(1, sizeof *c);
    if (c) c->calls = *calls;
    return c;
}}

EXPORT void fmi2FreeInstance(Component component)
{{
    Instance *c = component;
    if (c && c->calls.release) c->calls.release(c);
    else free(c);
}}

EXPORT Status fmi2SetupExperiment(Component component, Boolean tolerant, double tolerance, double start, Boolean ends,
                                  double stop)
{{
    Instance *c = component;
    (void)tolerant, (void)tolerance, (void)ends, (void)stop;
    c->start = c->time = start;
    return OK;
}}

static void begin(Instance *c)
{{
    if (!c->ready) {name}_plant_init(&c->axis, c->position, c->velocity);
    c->ready = 1;
}}

EXPORT Status fmi2EnterInitializationMode(Component component) {{ (void)component; return OK; }}
EXPORT Status fmi2ExitInitializationMode(Component component) {{ begin(component); return OK; }}
EXPORT Status fmi2Terminate(Component component) {{ (void)component; return OK; }}

EXPORT Status fmi2Reset(Component component)
{{
    Instance *c = component;
    const Callbacks calls = c->calls;
    memset(c, 0, sizeof *c);
    c->calls = calls;
    return OK;
}}

EXPORT Status fmi2GetReal(Component component, const Reference *which, size_t count, double *values)
{{
    const Instance *c = component;
    size_t i;
    for (i = 0; i < count; i++) {{
        switch (which[i]) {{
        case 0: values[i] = c->u; break;
        case 1: values[i] = c->ready ? c->axis.velocity : c->velocity; break;
        case 2: values[i] = c->ready ? c->axis.position : c->position; break;
        case 3: values[i] = c->velocity; break;
        case 4: values[i] = c->position; break;
        default: return Error;
        }}
    }}
    return OK;
}}

EXPORT Status fmi2SetReal(Component component, const Reference *which, size_t count, const double *values)
{{
    Instance *c = component;
    size_t i;
    for (i = 0; i < count; i++) {{
        switch (which[i]) {{
        case 0: c->u = values[i]; break;
        case 3: c->velocity = values[i]; break;
        case 4: c->position = values[i]; break;
        default: return Error;
        }}
    }}
    return OK;
}}

/* every tick of the clock that lies in the step, but for the one at its end, takes the u of the step */
EXPORT Status fmi2DoStep(Component component, double now, double step, Boolean kept)
{{
    Instance *c = component;
    const double end = now + step - c->start;
    (void)kept;
    begin(c);
    while (((double)c->axis.sample + 1e-6) * {clock} < end) {name}_plant_step(&c->axis, c->u);
    c->time = now + step;
    return OK;
}}

#define NOT_THERE(name, ...) EXPORT Status name(__VA_ARGS__)
NOT_THERE(fmi2SetDebugLogging, Component c, Boolean on, size_t n, const String *names)
{{ (void)c, (void)on, (void)n, (void)names; return OK; }}
NOT_THERE(fmi2GetInteger, Component c, const Reference *r, size_t n, int *x)
{{ (void)c, (void)r, (void)x; return n ? Error : OK; }}
NOT_THERE(fmi2GetBoolean, Component c, const Reference *r, size_t n, Boolean *x)
{{ (void)c, (void)r, (void)x; return n ? Error : OK; }}
NOT_THERE(fmi2GetString, Component c, const Reference *r, size_t n, String *x)
{{ (void)c, (void)r, (void)x; return n ? Error : OK; }}
NOT_THERE(fmi2SetInteger, Component c, const Reference *r, size_t n, const int *x)
{{ (void)c, (void)r, (void)x; return n ? Error : OK; }}
NOT_THERE(fmi2SetBoolean, Component c, const Reference *r, size_t n, const Boolean *x)
{{ (void)c, (void)r, (void)x; return n ? Error : OK; }}
NOT_THERE(fmi2SetString, Component c, const Reference *r, size_t n, const String *x)
{{ (void)c, (void)r, (void)x; return n ? Error : OK; }}
NOT_THERE(fmi2GetFMUstate, Component c, void **s) {{ (void)c, (void)s; return Error; }}
NOT_THERE(fmi2SetFMUstate, Component c, void *s) {{ (void)c, (void)s; return Error; }}
NOT_THERE(fmi2FreeFMUstate, Component c, void **s) {{ (void)c, (void)s; return Error; }}
NOT_THERE(fmi2SerializedFMUstateSize, Component c, void *s, size_t *n) {{ (void)c, (void)s, (void)n; return Error; }}
NOT_THERE(fmi2SerializeFMUstate, Component c, void *s, char x[], size_t n)
{{ (void)c, (void)s, (void)x, (void)n; return Error; }}
NOT_THERE(fmi2DeSerializeFMUstate, Component c, const char x[], size_t n, void **s)
{{ (void)c, (void)s, (void)x, (void)n; return Error; }}
NOT_THERE(fmi2GetDirectionalDerivative, Component c, const Reference *z, size_t m, const Reference *r, size_t n,
          const double *d, double *x)
{{ (void)c, (void)z, (void)m, (void)r, (void)n, (void)d, (void)x; return Error; }}
NOT_THERE(fmi2SetRealInputDerivatives, Component c, const Reference *r, size_t n, const int *o, const double *x)
{{ (void)c, (void)r, (void)n, (void)o, (void)x; return Error; }}
NOT_THERE(fmi2GetRealOutputDerivatives, Component c, const Reference *r, size_t n, const int *o, double *x)
{{ (void)c, (void)r, (void)n, (void)o, (void)x; return Error; }}
NOT_THERE(fmi2CancelStep, Component c) {{ (void)c; return Error; }}
NOT_THERE(fmi2GetStatus, Component c, int kind, Status *x) {{ (void)c, (void)kind, (void)x; return Discard; }}
NOT_THERE(fmi2GetRealStatus, Component c, int kind, double *x)
{{
    Instance *instance = c;
    if (kind != 2) return Discard;
    *x = instance->time;
    return OK;
}}
NOT_THERE(fmi2GetIntegerStatus, Component c, int kind, int *x) {{ (void)c, (void)kind, (void)x; return Discard; }}
NOT_THERE(fmi2GetBooleanStatus, Component c, int kind, Boolean *x) {{ (void)c, (void)kind, (void)x; return Discard; }}
NOT_THERE(fmi2GetStringStatus, Component c, int kind, String *x) {{ (void)c, (void)kind, (void)x; return Discard; }}
"""


def _write(joint: Joint) -> bytes:
    law = header(joint)
    guid = "{" + hashlib.sha256(law.encode()).hexdigest()[:32] + "}"
    known = {"name": joint.name, "guid": guid, "clock": number(joint.sample_time)}
    files = {
        "modelDescription.xml": _DESCRIPTION.format(title=comment(f"axis: {', '.join(joint.parts)}"), **known),
        "sources/fmu.c": _SOURCE.format(**known),
        "sources/joint.h": law,
    }
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(zipfile.ZipInfo(name, _DATE), text, zipfile.ZIP_DEFLATED)
    return out.getvalue()


def _run(content: bytes, joint: Joint, motion: Motion) -> Array:
    """Validated and simulated by fmpy, compiled by gcc."""
    try:
        import fmpy
        import fmpy.validation
    except ImportError:
        raise NotRun(f"fmpy is not installed: {how_to_install('export')}") from None
    with scratch() as name:
        folder = Path(name)
        (folder / "axis.fmu").write_bytes(content)
        problems = fmpy.validation.validate_fmu(str(folder / "axis.fmu"))
        if problems:
            raise DataError(f"fmpy finds a problem in the FMU: {problems[0][:200]}", "please report this")
        unzipped = Path(fmpy.extract(str(folder / "axis.fmu"), str(folder / "axis")))
        place = unzipped / "binaries" / fmpy.platform
        place.mkdir(parents=True)
        shared_library(unzipped / "sources", "fmu.c", place / f"{joint.name}{fmpy.sharedLibraryExtension}")
        return finite(_simulated(str(unzipped), joint, motion), "FMU")


def _simulated(unzipped: str, joint: Joint, motion: Motion) -> Array:
    import fmpy

    step, count = joint.sample_time, len(motion.u)
    rows = np.zeros(count, dtype=[("time", float), ("u", float)])
    rows["time"], rows["u"] = np.arange(count) * step, motion.u
    result = fmpy.simulate_fmu(
        unzipped,
        fmi_type="CoSimulation",
        step_size=step,
        output_interval=step,
        stop_time=(count - 1) * step,
        start_values={"velocity_start": motion.velocity, "position_start": motion.position},
        input=rows,
        output=["velocity"],
        validate=False,
    )
    return np.asarray(result["velocity"], dtype=float)[:count]


TARGET = Target(
    id="fmu",
    summary="FMI 2.0: a source FMU for co-simulation, in C.",
    suffix=".fmu",
    judge=judge,
    write=_write,
    run=_run,
)
