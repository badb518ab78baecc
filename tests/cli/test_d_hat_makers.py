"""`[observer] filter` and `u`: a d_hat that a drive made its own way, through the commands that read it."""

import csv
import json

import numpy as np
import pytest

from dsd_cli.identify.d_hat_makers import Beliefs, _OverMakers
from dsd_cli.identify.results import Estimate
from dsd_cli.plant.maker import FILTERS, PAIRINGS, Maker
from tests.cli.rig import FEW, dsd
from tests.oracle.d_hat_makers import made
from tests.oracle.rig_sensors import observe

J, JN, TAU, DELAY, B = 0.02, 0.03, 0.01, 0.006, 0.4
CONFIG = f"""
[signals]
time = "t"
[observer]
nominal_inertia = {JN}
time_constant = {TAU}
[model]
inertia = {J}
delay = {DELAY}
[states]
delays = [0.0, 0.003, {DELAY}, 0.012]
inertias = [0.01, {J}, 0.04]
[states.effects.viscous_friction]
coefficient = [{B}]
[detector]
window = 60
rho = 0.02
initial = {{ delay = 0.0, inertia = 0.01 }}
"""
MAKERS = [Maker(how, pairing) for how in FILTERS for pairing in PAIRINGS]


def motion(jitter=0.0, n=4000, smooth=False):
    """(t, u, v) of J v' = u(t - DELAY) - B v, exact under the hold; u a random staircase with a fine ripple, or
    sines of up to 9 Hz."""
    rng = np.random.default_rng(5)
    t = np.concatenate([[0.0], np.cumsum(0.001 * (1.0 + jitter * rng.uniform(-1.0, 1.0, n - 1)))])
    u = np.repeat(rng.uniform(-1.0, 1.0, n // 40), 40) + 0.05 * rng.standard_normal(n)
    if smooth:
        u = sum(0.3 * np.sin(2.0 * np.pi * (0.7 + 1.4 * k) * t + k * k) for k in range(7))
    fine = np.arange(0.0, t[-1], 1e-4)
    acting = u[np.maximum(np.searchsorted(t, fine - DELAY, side="right") - 1, 0)]
    v, keep, speeds = 0.0, np.exp(-B / J * 1e-4), np.empty(len(fine))
    for k, force in enumerate(acting.tolist()):
        speeds[k] = v
        v = keep * v + (1.0 - keep) * force / B
    return t, u, np.interp(t, fine, speeds)


def write(path, t, u, d_hat, v=None):
    names, columns = ["t", "u", "d_hat"], [t, u, d_hat]
    if v is not None:
        names, columns = [*names, "velocity"], [*columns, v]
    np.savetxt(path, np.stack(columns, axis=1), delimiter=",", header=",".join(names), comments="", fmt="%.17g")


def observer(maker):
    return CONFIG.replace("[model]", f'filter = "{maker.filter}"\nu = "{maker.u}"\n[model]')


def detected(folder, config, *more):
    (folder / "dsd.toml").write_text(config)
    done = dsd("detect", "log.csv", "-c", "dsd.toml", "--format", "json", *more, cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def right_share(result):
    return next(s["share"] for s in result["states"] if (s["delay"], s["inertia"]) == (DELAY, J))


@pytest.fixture(scope="module")
def left_as_here(tmp_path_factory):
    """rms of d_hat that the labels leave unexplained where d_hat was made as here."""
    folder = tmp_path_factory.mktemp("here")
    t, u, v = motion()
    write(folder / "log.csv", t, u, observe(t, u, v, JN, TAU), v)
    return detected(folder, CONFIG)["residual_rms"]


@pytest.mark.parametrize("maker", [m for m in MAKERS if not m.as_here], ids=str)
def test_detect_predicts_what_that_maker_would_have(maker, left_as_here, tmp_path):
    """Its labels leave what those of d_hat as here do; read as if it were made as here, 3 to 16 times that."""
    t, u, v = motion()
    write(tmp_path / "log.csv", t, u, made(t, u, v, JN, TAU, maker.filter, maker.u), v)
    result = detected(tmp_path, observer(maker))
    assert result["residual_rms"] < 1.05 * left_as_here
    assert right_share(result) > 0.97


def test_labels_of_a_converted_log_are_those_of_d_hat_as_here(tmp_path):
    t, u, v = motion(jitter=0.3)
    written = {}
    for name, d_hat, config in (
        ("here", observe(t, u, v, JN, TAU), CONFIG),
        ("theirs", made(t, u, v, JN, TAU, "euler", "newest"), observer(Maker("euler", "newest"))),
    ):
        write(tmp_path / "log.csv", t, u, d_hat, v)
        detected(tmp_path, config, "-o", f"{name}.csv")
        written[name] = np.genfromtxt(tmp_path / f"{name}.csv", delimiter=",", names=True)["state"]
    assert np.mean(written["here"] == written["theirs"]) > 0.998


def test_a_stream_is_converted_as_the_file_is(tmp_path):
    t, u, v = motion(n=1520)
    write(tmp_path / "log.csv", t, u, made(t, u, v, JN, TAU, "bilinear", "newest"), v)
    detected(tmp_path, observer(Maker("bilinear", "newest")), "-o", "file.csv")
    done = dsd("detect", "-", "-c", "dsd.toml", cwd=tmp_path, stdin=(tmp_path / "log.csv").read_text())
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1:] == (tmp_path / "file.csv").read_text().splitlines()[1:]


def test_a_log_that_dsd_made_is_left_alone(tmp_path):
    """`observe` computes d_hat by itself: what its input's d_hat was made by does not matter any more."""
    t, u, v = motion(n=1520)
    write(tmp_path / "log.csv", t, u, made(t, u, v, JN, TAU, "euler", "newest"), v)
    (tmp_path / "dsd.toml").write_text(observer(Maker("euler", "newest")))
    done = dsd("observe", "log.csv", "-c", "dsd.toml", "-o", "observed.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (tmp_path / "log.csv").unlink()
    for name in ("observed.csv", "observed.csv.meta.json"):
        (tmp_path / name).rename(tmp_path / name.replace("observed", "log"))
    assert detected(tmp_path, observer(Maker("euler", "newest")))["states"] == detected(tmp_path, CONFIG)["states"]


def test_values_from_u_and_d_hat_alone_are_the_true_ones(tmp_path):
    """Of euler and the newest u, too, which "auto" finds below."""
    t, u, v = motion(n=2000)
    write(tmp_path / "log.csv", t, u, made(t, u, v, JN, TAU, "bilinear", "mean"))
    (tmp_path / "dsd.toml").write_text(observer(Maker("bilinear", "mean")))
    done = dsd("diagnose", "log.csv", "-c", "dsd.toml", "--format", "json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    values_are_true(json.loads(done.stdout))


def values_are_true(result):
    assert result["verdict"] == "viscous_friction"
    found = {**result["estimates"], **(result.get("found_values") or {})}
    assert found["viscous_friction.coefficient"]["value"] == pytest.approx(B, rel=0.02)
    assert found["inertia"]["value"] == pytest.approx(J, rel=0.02)


def test_a_word_that_is_no_filter_is_refused(tmp_path):
    (tmp_path / "dsd.toml").write_text(CONFIG.replace("[model]", 'filter = "tustin"\n[model]'))
    write(tmp_path / "log.csv", *motion(n=1520))
    done = dsd("detect", "log.csv", "-c", "dsd.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert 'observer.filter = "tustin"' in done.stderr
    assert "bilinear" in done.stderr


# -- found in the log ------------------------------------------------------------------------------------------------


def checked(folder, config):
    (folder / "dsd.toml").write_text(config)
    done = dsd("check", "log.csv", "-c", "dsd.toml", "--format", "json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return [f for f in json.loads(done.stdout)["findings"] if f["channel"] == "d_hat"]


def noisy(maker, seed=1, n=4000):
    """A log whose speed has noise of a 500th that d_hat does not share, and d_hat white noise of 1 % of u."""
    t, u, v = motion(n=n)
    rng = np.random.default_rng(seed)
    d_hat = made(t, u, v, JN, TAU, maker.filter, maker.u) + 0.01 * np.std(u) * rng.standard_normal(len(t))
    return t, u, d_hat, v + 2e-3 * np.std(v) * rng.standard_normal(len(t))


@pytest.mark.parametrize("maker", [m for m in MAKERS if not m.as_here], ids=str)
def test_check_names_the_maker_and_the_keys(maker, tmp_path):
    write(tmp_path / "log.csv", *noisy(maker))
    (finding,) = checked(tmp_path, CONFIG)
    assert f'observer.filter = "{maker.filter}" and observer.u = "{maker.u}"' in finding["remedy"]


def test_check_is_silent_of_a_maker_that_is_as_the_config_says(tmp_path):
    for maker in (Maker(), Maker("euler", "newest"), Maker("bilinear", "mean")):
        write(tmp_path / "log.csv", *noisy(maker))
        assert not checked(tmp_path, observer(maker))


def test_check_of_a_maker_that_is_not_the_one_of_the_config(tmp_path):
    write(tmp_path / "log.csv", *noisy(Maker("euler", "newest")))
    (finding,) = checked(tmp_path, observer(Maker("exact", "mean")))
    assert 'observer.filter = "auto"' in finding["remedy"]


AUTO = CONFIG.replace("[model]", 'filter = "auto"\nu = "auto"\n[model]')


def test_auto_is_the_maker_of_the_log(tmp_path):
    maker = Maker("euler", "newest")
    write(tmp_path / "log.csv", *noisy(maker))
    assert detected(tmp_path, AUTO)["states"] == detected(tmp_path, observer(maker))["states"]
    assert right_share(detected(tmp_path, AUTO)) > 0.97


def test_auto_needs_a_file(tmp_path):
    write(tmp_path / "log.csv", *noisy(Maker()))
    (tmp_path / "dsd.toml").write_text(AUTO)
    done = dsd("detect", "-", "-c", "dsd.toml", cwd=tmp_path, stdin=(tmp_path / "log.csv").read_text())
    assert done.returncode == 2
    assert 'filter and u = "auto" needs a log in a file' in done.stderr


def test_auto_of_u_and_d_hat_alone_is_the_maker_that_explains_the_log(tmp_path):
    """The log as of the newest u and Euler is explained by viscous friction; as of any other it is not quite."""
    t, u, d_hat, _ = noisy(Maker("euler", "newest"))
    write(tmp_path / "log.csv", t, u, d_hat)
    (tmp_path / "dsd.toml").write_text(AUTO)
    done = dsd("diagnose", "log.csv", "-c", "dsd.toml", "--format", "json", cwd=tmp_path, effects=FEW)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["provenance"]["d_hat"] == "logged, made with filter euler, newest u"
    values_are_true(result)


def diagnosed(folder, config, log):
    write(folder / "log.csv", *log)
    (folder / "dsd.toml").write_text(config)
    done = dsd("diagnose", "log.csv", "-c", "dsd.toml", "--format", "json", cwd=folder, effects=FEW)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


SAID = "made with filter exact, newest u"


def test_diagnose_says_nothing_of_d_hat_that_was_made_as_here(tmp_path):
    t, u, d_hat, _ = noisy(Maker(), n=2000)
    assert SAID not in str(diagnosed(tmp_path, CONFIG, (t, u, d_hat))["advice"])


@pytest.mark.parametrize("more", [["other.csv"], ["--holdout", "other.csv"]], ids=["logs", "holdout"])
def test_who_made_d_hat_is_asked_of_several_logs_as_of_one(more, tmp_path):
    """Read as made here, the delay is a sample off."""
    for seed, name in ((1, "log.csv"), (2, "other.csv")):
        t, u, d_hat, _ = noisy(Maker("exact", "newest"), seed, n=2000)
        write(tmp_path / name, t, u, d_hat)
    (tmp_path / "dsd.toml").write_text(CONFIG)
    done = dsd("diagnose", "log.csv", *more, "-c", "dsd.toml", "--format", "json", cwd=tmp_path, effects=FEW)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert "made with exact" in found["advice"][0].replace("filter ", "")
    assert found["provenance"]["d_hat"] == "logged, made with filter exact, newest u"
    assert found["estimates"]["delay"]["value"] == pytest.approx(DELAY, abs=3e-4)


def answered(folder, command, *words, stdin=None):
    done = dsd(command, *words, "-c", "dsd.toml", "--format", "json", cwd=folder, stdin=stdin, effects=FEW)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr


@pytest.fixture(scope="module")
def unsaid(tmp_path_factory):
    """A log of a maker that its config does not name."""
    folder = tmp_path_factory.mktemp("unsaid")
    t, u, d_hat, _ = noisy(Maker("exact", "newest"), n=2000)
    write(folder / "log.csv", t, u, d_hat)
    (folder / "dsd.toml").write_text(CONFIG)
    return folder


@pytest.mark.parametrize("log", ["log.csv", "-"], ids=["file", "stream"])
def test_add_fits_the_log_of_the_maker_that_diagnose_finds_and_says_so(log, unsaid):
    """Read as made here, the delay is a sample off."""
    stdin = None if log != "-" else (unsaid / "log.csv").read_text()
    words = ("viscous_friction", "-o", "better.toml")
    found, said = answered(unsaid, "add", log, *words, stdin=stdin)
    assert found["estimates"]["delay"]["value"] == pytest.approx(DELAY, abs=3e-4)
    assert said.count(SAID) == 1
    assert 'observer.filter = "exact" and observer.u = "newest"' in said


def test_a_fleet_says_what_diagnose_says_which_names_the_maker_first(unsaid):
    alone = answered(unsaid, "diagnose", "log.csv")[0]
    assert SAID in alone["advice"][0]
    words = ("log.csv", "-c", "dsd.toml", "-o", "fleet.csv", "--workers", "1")
    done = dsd("fleet", "diagnose", *words, cwd=unsaid, effects=FEW)
    assert done.returncode == 0, done.stderr
    (row,) = csv.DictReader((unsaid / "fleet.csv").open())
    assert row["verdict"] == alone["verdict"]
    assert float(row["value.delay"]) == pytest.approx(alone["estimates"]["delay"]["value"], rel=1e-6)


def test_a_stream_with_one_of_both_keys_says_how_the_other_is_read(unsaid):
    (unsaid / "dsd.toml").write_text(CONFIG.replace("[model]", 'filter = "exact"\n[model]'))
    said = answered(unsaid, "diagnose", "-", stdin=(unsaid / "log.csv").read_text())[1]
    (unsaid / "dsd.toml").write_text(CONFIG)
    assert 'observer.u is not given, and a stream is not asked who made d_hat: it is read as "previous"' in said


def test_errors_hold_the_truth_whoever_made_d_hat(tmp_path):
    """Told the wrong maker, the delay of a smooth motion is off by many standard errors; told none, the error holds the
    doubt: makers half a sample apart stay apart."""
    t, u, v = motion(n=3000, smooth=True)
    d_hat = made(t, u, v, JN, TAU, "exact", "newest") + 1e-3 * np.random.default_rng(2).standard_normal(len(t))
    off = {}
    for told in (CONFIG, observer(Maker())):
        found = diagnosed(tmp_path, told, (t, u, d_hat))["estimates"]
        off[told] = abs(found["delay"]["value"] - DELAY) / found["delay"]["std_error"]
        if told is CONFIG:
            assert found["delay"]["std_error"] > 1e-4
            assert abs(found["inertia"]["value"] - J) < 2.5 * found["inertia"]["std_error"]
    assert off[CONFIG] < 2.5
    assert off[observer(Maker())] > 10.0


def test_a_value_over_makers_is_one_of_their_mixture():
    """Mean and spread of draws from it; phases go round; who is ruled out does not count."""
    rng, makers, share, error = np.random.default_rng(4), MAKERS[:4], np.array([0.5, 0.3, 0.199, 0.001]), 0.1
    values = [{"delay": v, "cogging.phase": p} for v, p in ((1.0, 3.1), (1.4, -3.1), (0.7, 3.1), (90.0, 0.0))]
    beliefs = Beliefs(dict(zip(makers, share, strict=True)), dict(zip(makers, values, strict=True)))
    over = _OverMakers(beliefs, makers[0], 0.01)
    found = over.value("delay", Estimate(1.0, error, "s"))
    draws = rng.choice([1.0, 1.4, 0.7], 200_000, p=share[:3] / share[:3].sum()) + error * rng.normal(size=200_000)
    assert found.value == pytest.approx(draws.mean(), abs=0.005)
    assert found.std_error == pytest.approx(draws.std(), rel=0.01)
    assert over.value("cogging.phase", Estimate(3.1, error, "rad")).std_error < 1.1 * error
    held = Estimate(1.0, 0.0, "s", held=True)
    assert over.value("delay", held) == held
