"""docs/how-to.md, word by word: its files are written, its commands run in the order shown."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from push_ros.process import prepare_environment

pytestmark = [pytest.mark.live, pytest.mark.long]
ROOT = Path(__file__).resolve().parents[2]
SERVERS = {"launch": "running ", "play": "http://"}  # verbs that go on, and what they say first
ENDS = {"planar-push rerun demo/bag --set planner.push_speed=0.06": 1}
SAYS = {"planar-push rerun demo/bag": "equal to the bit"}


def steps():
    """(name, text) of each file and (None, line) of each command, in the page's order."""
    text = (ROOT / "docs" / "how-to.md").read_text()
    for language, block in re.findall(r"^```(\w+)\n(.*?)^```", text, re.M | re.S):
        if language == "sh":
            yield from ((None, line) for line in block.splitlines())
        else:
            yield re.match(r"# ([\w.]+)\n", block)[1], block


def served(line, folder, environment, sign):
    """Start a command that goes on until Ctrl-C; whether it said that it is there, and its end."""
    process = subprocess.Popen(
        ["bash", "-c", f"exec env {line}"],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    said = []
    try:
        for spoken in process.stdout:
            said.append(spoken)
            if sign in spoken:
                break
        process.send_signal(signal.SIGINT)
        said.append(process.communicate(timeout=60)[0])
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    return process.returncode, "".join(said)


def test_each_file_and_each_command_does_what_the_page_says(domain, tmp_path):
    environment = prepare_environment(dict(os.environ)) | {"PLANAR_PUSH": str(ROOT)}
    environment["PATH"] = f"{Path(sys.executable).parent}:{environment['PATH']}"
    commands = 0
    for name, text in steps():
        if name is not None:
            (tmp_path / name).write_text(text)
            continue
        commands += 1
        verb = re.search(r"planar-push (\w+)", text)
        if verb and verb[1] in SERVERS:
            line = text.replace("--view", "") + (" --port 0" if verb[1] == "play" else "")
            code, said = served(line, tmp_path, environment, SERVERS[verb[1]])
            assert SERVERS[verb[1]] in said, f"{text}\n{said}"
        else:
            done = subprocess.run(
                ["bash", "-c", text],
                cwd=tmp_path,
                env=environment,
                capture_output=True,
                text=True,
                timeout=300,
                check=False,
            )
            code, said = done.returncode, done.stdout + done.stderr
        assert code == ENDS.get(text, 0), f"{text}\n{said}"
        assert SAYS.get(text, "") in said, f"{text}\n{said}"
    assert commands >= 8
    assert (tmp_path / "demo" / "report.html").exists() and (tmp_path / "study").is_dir()
