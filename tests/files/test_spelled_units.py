"""Units in whole words, and those that the number of a drive's object says."""

import pytest

from dsd_cli.files.names_in import is_unit, unit_in
from dsd_cli.files.recognise import Recognised, is_motion, recognise
from dsd_cli.files.words import plain_unit

#: Unit of a position, a velocity and of u -> what one of it is in SI, by the definitions of the units.
WORDS = {
    "position": {
        "Micrometers": 1e-6, "Micrometres": 1e-6, "Microns": 1e-6, "micron": 1e-6, "Millimeters": 1e-3,
        "millimetre": 1e-3, "Centimetres": 1e-2, "Meters": 1.0, "metres": 1.0, "Radians": 1.0, "Milliradians": 1e-3,
        "Degrees": 0.017453292519943295, "Revolutions": 6.283185307179586, "Rotations": 6.283185307179586,
        "Turns": 6.283185307179586,
    },
    "velocity": {
        "Meters per Second": 1.0, "Millimeters/Second": 1e-3, "Millimetres per Minute": 1e-3 / 60.0,
        "Radians per second": 1.0, "Degrees/s": 0.017453292519943295, "Revolutions per Minute": 0.10471975511965977,
        "metres / sec": 1.0,
    },
    "u": {
        "Amperes": 1.0, "Milliamperes": 1e-3, "Milliamps": 1e-3, "Newtons": 1.0, "Kilonewtons": 1e3, "Volts": 1.0,
        "Millivolts": 1e-3, "Newton Meters": 1.0, "Newton-metres": 1.0, "Millinewton metres": 1e-3,
    },
}  # fmt: skip
CASES = [(role, unit, size) for role, units in WORDS.items() for unit, size in units.items()]


@pytest.mark.parametrize(("role", "unit", "size"), CASES)
def test_a_unit_in_words_has_its_size(role: str, unit: str, size: float) -> None:
    for text in (unit, unit.lower(), unit.upper()):
        one = Recognised(role, "column", text)
        assert one.factor == pytest.approx(size, rel=1e-12), text
        assert is_unit(text)
        assert one.named


@pytest.mark.parametrize(
    ("name", "role", "factor"),
    [
        ("Pos Micrometers", "position", 1e-6),
        ("stage_position_millimetres", "position", 1e-3),
        ("Position [Microns]", "position", 1e-6),
        ("Speed in Meters/Second", "velocity", 1.0),
        ("motor current milliamperes", "u", 1e-3),
        ("Force Newtons", "u", 1.0),
    ],
)
def test_also_in_a_name(name: str, role: str, factor: float) -> None:
    assert recognise([name])[role].factor == pytest.approx(factor)


def test_a_meter_at_the_end_of_a_name_measures() -> None:
    assert unit_in("angle_meter", "position") == ""


@pytest.mark.parametrize(
    ("name", "unit"), [("theta_m", ""), ("phi_m/1", ""), ("q_m", ""), ("pos_m", "m"), ("x_m", "m")]
)
def test_an_angle_is_in_no_metres_but_may_be_that_of_the_motor(name: str, unit: str) -> None:
    assert unit_in(name, "position") == unit


@pytest.mark.parametrize(
    "form", ["{} actual value ({}h)", "{} actual value (0x{})", "0x{1}: {0}", "{1}h {0} actual value"]
)
def test_the_number_of_an_object_is_no_unit_and_says_which_it_has(form: str) -> None:
    """CiA 402: torque and current in per mille of what the drive is rated for; places in increments by default."""
    objects = {"u": ("Torque", "6077"), "position": ("Position", "6064"), "velocity": ("Velocity", "606C")}
    names = {role: form.format(*one) for role, one in objects.items()}
    found = recognise([*names.values()])
    assert {role: found[role].column for role in names} == names
    assert {role: found[role].unit for role in names} == {"u": "‰", "position": "inc", "velocity": "inc/s"}
    assert (found["u"].named, found["u"].factor) == ("%", 0.1)


def test_the_speed_of_an_object_is_in_increments_where_nobody_changed_that() -> None:
    """Drives log rpm or 0.1 rpm there as well: no sentence may hold it for certain."""
    assert recognise(["Velocity actual value (606Ch)"])["velocity"].spoken == "inc/s by default"
    assert recognise(["Velocity actual value (606Ch) [rpm]"])["velocity"].spoken == "rpm"
    assert recognise(["Speed [inc/s]"])["velocity"].spoken == "inc/s"


def test_a_unit_that_is_said_is_that_of_the_object() -> None:
    assert recognise(["0x6064: Position [deg]"])["position"].named == "deg"


@pytest.mark.parametrize("unit", ["meters per second per second", "radian/s/s", "revolutions per minute per second"])
def test_an_acceleration_is_no_speed(unit: str) -> None:
    assert plain_unit(unit).count("/") == 2


def test_a_capital_t_is_a_torque_a_small_one_is_the_time() -> None:
    """T_em, the torque of the air gap, was taken as a second time, and so could not be u."""
    found = recognise(["t", "theta_m", "omega_m", "T_em"])
    assert (found["time"].column, found["time"].others) == ("t", ())
    assert not is_motion("T_em", "")
    assert [recognise([name])["time"].column for name in ("T_ms", "T_sec", "t_log", "T")]


def test_errors_accelerations_and_currents_are_no_places() -> None:
    """Of each it was said that it could be the position as well."""
    groups = ["field.actual.positions0", "field.error.positions0"]
    assert recognise(groups)["position"].others == ()
    asked = ["X Position Command (mm)", "X Acceleration Command (mm/s^2)"]
    assert recognise(asked)["reference"].others == ()
    assert recognise(["position_rev", "q_A", "d_A"])["position"].others == ()
    assert recognise(["torque of acceleration feedforward"])["u"].column
