"""`dsd report`: the results of the other commands on one page, whole or not at all."""

import html
import json
import os
import re
import shlex
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import pytest

from tests import warm
from tests.cli.rig import CONFIG, DSD, csv_text, done, dsd, make_log, refused, write
from tests.report.page.conftest import ARGUMENTS, EFFECTS, folder  # noqa: F401 (a fixture)

MODEL = "\n[model]\ninertia = 1.0\ndelay = 0.005\n"


def results(page: str | Path) -> dict:
    """The JSON that the page holds for scripts."""
    text = page if isinstance(page, str) else page.read_text("utf-8")
    (found,) = re.findall(r'<script type="application/json" id="results">(.*?)</script>', text)
    return json.loads(found)


def drawn(page: str) -> dict:
    """The charts that the page draws."""
    return json.loads(re.findall(r'id="data">(.*?)</script>', page)[0])["charts"]


def command(*arguments: str, cwd: Path) -> dict:
    """What a command prints as JSON."""
    made = warm.run(*arguments, "--format", "json", cwd=cwd, effects=EFFECTS)
    assert made.returncode == 0, made.stderr
    return json.loads(made.stdout)


@pytest.mark.parametrize("name", ["check", "compare"])
def test_the_page_has_the_numbers_of_the_commands(folder, name):  # noqa: F811
    assert results(folder / "page.html")[name] == command(name, *ARGUMENTS, cwd=folder)


def test_the_page_has_ladder_first_verdict_and_config(folder, tmp_path):  # noqa: F811
    page = (folder / "page.html").read_text("utf-8")
    found, better = results(page), tmp_path / "better.toml"
    improved = command("improve", *ARGUMENTS, "--auto", "--states", "-o", str(better), cwd=folder)
    assert found["improve"] == improved | {"config": None}
    diagnosed = command("diagnose", *ARGUMENTS, cwd=folder)
    assert found["diagnose"] == diagnosed
    assert found["missing"] == {}
    assert found["detect"][0] == command("detect", *ARGUMENTS, "-c", str(better), cwd=folder)
    config = json.loads(re.findall(r'id="data">(.*?)</script>', page)[0])["copies"]["config"]
    stamp = r"20\d\d-\d\d-\d\d[T ]\d\d:\d\d:\d\dZ"
    assert re.sub(stamp, "", config) == re.sub(stamp, "", better.read_text("utf-8"))


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    here = tmp_path_factory.mktemp("report")
    (here / "dsd.toml").write_text(CONFIG + MODEL)
    write(here, "log.csv", make_log(600))
    write(here, "short.csv", make_log(45))
    (here / "bare.toml").write_text(CONFIG)
    (here / "stateless.toml").write_text("[observer]\nnominal_inertia = 1.0\ntime_constant = 0.002\n" + MODEL)
    (here / "still.csv").write_text("t,u,position\n" + "".join(f"{i / 1000},0.5,1.0\n" for i in range(300)))
    return here


@pytest.mark.parametrize(
    ("arguments", "code", "texts"),
    [
        (("log.csv",), 2, ["-o is missing", "report.html"]),
        (("log.csv", "-o", "page.pdf"), 2, [".html"]),
        (("log.csv", "-o", "log.csv"), 2, [".html"]),
        (("log.html", "-o", "log.html"), 2, ["is the input"]),
        (("log.csv", "-c", "dsd.html", "-o", "dsd.html"), 2, ["is the input"]),
        (("log.csv", "-o", "nowhere/page.html"), 1, ["no such folder"]),
        (("log.csv", "-o", "folder.html"), 1, ["is a directory"]),
        (("none.csv", "-o", "page.html"), 1, ["none.csv"]),
        (("log.csv", "log.csv", "-o", "page.html"), 2, ["given twice"]),
        (("-", "-o", "page.html"), 2, ["<stdin>", "several times"]),
        (("log.csv", "-c", "none.toml", "-o", "page.html"), 2, ["none.toml"]),
        (("log.csv", "--fix", "mass=1", "-o", "page.html"), 2, ["mass"]),
        (("log.csv", "--set", "signals.u=current", "-o", "page.html"), 1, ["current"]),
        (("log.csv", "--from", "5", "-o", "page.html"), 1, ["log.csv"]),
    ],
)
def test_what_cannot_work_is_one_line_and_leaves_nothing(rig, arguments, code, texts):
    (rig / "folder.html").mkdir(exist_ok=True)
    (rig / "log.html").write_bytes((rig / "log.csv").read_bytes())
    (rig / "dsd.html").write_bytes((rig / "dsd.toml").read_bytes())
    before = {path.name: path.stat().st_size for path in rig.iterdir()}
    refused(dsd("report", *arguments, cwd=rig), code, *texts)
    assert {path.name: path.stat().st_size for path in rig.iterdir()} == before


def missing(rig: Path, *arguments: str) -> tuple[dict, str, str]:
    """What the page has not, the page, and what was said."""
    made = warm.run("report", *arguments, "-o", "part.html", cwd=rig, effects=warm.FEW)
    assert (made.returncode, made.stdout) == (0, ""), made.stderr
    page = (rig / "part.html").read_text("utf-8")
    return results(page), page, made.stderr


def test_a_step_that_fails_is_a_line_and_not_the_end(rig):
    found, page, said = missing(rig, "short.csv")
    assert set(found["missing"]) >= {"compare", "diagnose", "improve"}
    assert found["check"]["by_log"][0]["samples"] == 45
    for name in ("compare", "improve"):
        assert found[name] is None
        assert found["missing"][name] in page
        assert "short.csv" in found["missing"][name]
    assert "dsd: warning: " in said
    assert "wrote part.html" in said


def test_an_axis_that_stands_still_and_a_config_without_inertia_or_states(rig):
    found, page, _ = missing(rig, "still.csv", "-c", "dsd.toml")
    assert "does not move" in found["missing"]["improve"]
    assert found["check"]["can_answer"] is False
    assert "still.csv cannot answer as it is: " in page
    assert {"u", "position"} <= set(drawn(page)), "channels are drawn without any model"
    found, page, _ = missing(rig, "log.csv", "-c", "bare.toml", "--quiet")
    assert "inertia" in found["missing"]["compare"]
    assert found["detect"][0]["samples"] == 600
    assert {"u", "d_hat", "label-delay", "label-inertia"} <= set(drawn(page))
    found, page, said = missing(rig, "log.csv", "-c", "stateless.toml", "--quiet")
    assert found["detect"] == []
    assert "the config has no [states]" in page
    assert found["compare"] is not None
    assert said == ""


def test_two_logs_and_one_held_out(rig):
    write(rig, "b.csv", make_log(500, seed=2))
    write(rig, "c.csv", make_log(550, seed=3))
    found, page, _ = missing(rig, "log.csv", "b.csv", "--holdout", "c.csv", "--set", 'detector.method="profile"')
    assert found["log"] == ["log.csv", "b.csv"]
    assert [one["log"] for one in found["detect"]] == ["log.csv", "b.csv"]
    assert found["compare"]["holdout"]["log"] == "c.csv"
    assert found["diagnose"]["holdout"] == ["c.csv"]
    assert "held out: c.csv" in page
    data = json.loads(re.findall(r'id="data">(.*?)</script>', page)[0])
    assert "force-step" in drawn(page)
    assert [log["name"] for log in data["logs"]] == ["log.csv", "b.csv"]
    assert data["end"] > 1.0
    estimated = next(one for one in data["charts"]["label-delay"]["series"] if one["name"] == "estimated")
    times, values = estimated["data"][0]
    assert times[-1] > 1.0
    assert abs(values[-1] - 0.005) < 0.001, "the delay that the log was made with"


def test_the_command_on_the_page_makes_the_page_again(rig):
    odd = "a 'log' $x.csv"
    (rig / odd).write_text(csv_text(make_log(45)))  # too short for all but check: the page is made at once
    arguments = ["report", odd, "-o", "my page.html", "--set", "model.delay=0.004", "--quiet"]
    done(*arguments, cwd=rig)
    page = (rig / "my page.html").read_text("utf-8")
    (shown,) = re.findall(r'<pre id="command-text">(.*?)</pre>', page, flags=re.DOTALL)
    line = html.unescape(shown)
    assert shlex.split(line) == ["dsd", *arguments]
    (rig / "my page.html").unlink()
    name = rig / "bin"
    name.mkdir(exist_ok=True)
    (name / "dsd").write_text(f'#!/bin/sh\nexec {shlex.join(DSD)} "$@"\n')
    (name / "dsd").chmod(0o755)
    path = os.pathsep.join([str(name), os.environ["PATH"]])
    subprocess.run(["sh", "-c", line], cwd=rig, check=True, env={**os.environ, "PATH": path}, timeout=300)
    again = (rig / "my page.html").read_text("utf-8")
    stamp = r"20\d\d-\d\d-\d\d[T ]\d\d:\d\d:\d\d"
    assert re.sub(stamp, "", again) == re.sub(stamp, "", page)


def test_to_stdout_and_into_a_device(rig):
    made = subprocess.run([*DSD, "report", "short.csv", "-o", "-"], cwd=rig, capture_output=True, check=True)
    assert made.stdout.startswith(b"<!doctype html>")
    assert made.stdout.decode("utf-8").endswith("</html>\n")
    (rig / "dev.html").symlink_to("/dev/null")
    before = os.stat("/dev/null")
    done("report", "short.csv", "-o", "dev.html", cwd=rig)
    assert (rig / "dev.html").is_symlink()
    assert os.stat("/dev/null").st_ino == before.st_ino


class Links(HTMLParser):
    """What a page would fetch or go to."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self.policy = ""
        self.feed(source)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.found += [given[name] for name in ("src", "href", "action", "data", "poster", "srcset") if name in given]
        if given.get("http-equiv") == "Content-Security-Policy":
            self.policy = given["content"]


def test_nothing_on_the_page_names_a_server(folder):  # noqa: F811
    page = (folder / "page.html").read_text("utf-8")
    links = Links(page)
    assert all(link.startswith("#") for link in links.found)
    assert "default-src 'none'" in links.policy
    assert "'unsafe-inline'" not in links.policy.split("script-src")[1]
    assert not re.search(r"@import|url\s*\(", page.split("<body")[0])
