"""The name of the source with which a bag or a study was made."""

import subprocess

import pytest

from push_record import revision as module
from push_record.revision import revision


@pytest.fixture
def source(tmp_path, monkeypatch):
    """A file of a repository with one commit, for which ``revision`` takes its own."""
    folder = tmp_path / "repository" / "push_record"
    folder.mkdir(parents=True)
    file = folder / "revision.py"
    file.write_text("a = 1\n")
    who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    for words in (["init", "-q"], ["add", "."], [*who, "commit", "-qm", "first"]):
        subprocess.run(["git", "-C", str(folder), *words], check=True)
    monkeypatch.setattr(module, "__file__", str(file))
    return file


def test_different_changes_that_are_not_committed_have_different_revisions(source):
    clean = revision()
    assert len(clean) == 12 and "dirty" not in clean
    found = []
    for text in ("a = 2\n", "a = 3\n", "a = 2\n"):
        source.write_text(text)
        found.append(revision())
    assert found[0] != found[1] and found[0] == found[2]
    assert all(r.startswith(f"{clean}-") and r.endswith("-dirty") for r in found)
    subprocess.run(["git", "-C", str(source.parent), "add", "."], check=True)
    assert revision() == found[0]  # staged or not
    subprocess.run(["git", "-C", str(source.parent), "reset", "-q", "--hard"], check=True)
    assert revision() == clean


def test_without_git_there_is_no_revision(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "__file__", str(tmp_path / "push_record" / "revision.py"))
    assert revision() == ""
