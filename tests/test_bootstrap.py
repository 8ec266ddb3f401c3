"""The set-up script: what it refuses, what it hands on, when it does nothing."""

from __future__ import annotations

import ast
import builtins
import sys
from pathlib import Path

import pytest

import bootstrap

LISTING = """\
:env:.default-timeout='180'
global.cert='/etc/certs.pem'
global.default-timeout='60'
global.extra-index-url='first\\nsecond'
global.index-url='low'
install.index-url='high'
freeze.index-url='other'
global.find-links='a b'
garbage
"""


def test_old_python_is_named_with_its_fix(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "version_info", (3, 9, 2))
    with pytest.raises(bootstrap.SetupError, match=r"needs Python 3\.11 or newer; .* is 3\.9\.\n.*python3-venv"):
        bootstrap.check_python()


def test_missing_venv_module_is_named_with_its_fix(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without_ensurepip(name: str, *rest: object) -> object:
        if name == "ensurepip":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return real(name, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(builtins, "__import__", without_ensurepip)
    version = "{}.{}".format(*sys.version_info)
    with pytest.raises(bootstrap.SetupError, match=f"no ensurepip module.*\n.*apt install python{version}-venv"):
        bootstrap.check_python()


def test_script_is_readable_for_old_pythons() -> None:
    """Python 3.6 must get as far as the message that it is too old."""
    source = Path(bootstrap.__file__).read_text(encoding="utf-8")
    tree = ast.parse(source, feature_version=(3, 6))
    imported = {
        name.split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in ([node.module or ""] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names])
    }
    assert imported <= sys.stdlib_module_names and "__future__" not in imported


def test_pip_configuration_is_read_with_its_precedence() -> None:
    assert bootstrap.pip_settings(LISTING) == {
        "default-timeout": "180",
        "cert": "/etc/certs.pem",
        "extra-index-url": "first second",
        "index-url": "high",
        "find-links": "a b",
    }


def test_uv_follows_pip_but_not_over_the_users_own_word() -> None:
    environ = bootstrap.uv_environ(LISTING, {"UV_DEFAULT_INDEX": "mine", "PATH": "p"})
    assert environ == {
        "PATH": "p",
        "UV_DEFAULT_INDEX": "mine",
        "UV_INDEX": "first second",
        "UV_FIND_LINKS": "a,b",
        "SSL_CERT_FILE": "/etc/certs.pem",
        "UV_HTTP_TIMEOUT": "180",
        "UV_INDEX_STRATEGY": "unsafe-best-match",
    }


def test_other_environments_do_not_leak_in(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("VIRTUAL_ENV", "CONDA_PREFIX", "PYTHONHOME", "PYTHONPATH"):
        monkeypatch.setenv(name, "/elsewhere")
    monkeypatch.setenv("KEPT", "yes")
    environ = bootstrap.clean_environ()
    assert "/elsewhere" not in environ.values() and environ["KEPT"] == "yes"


@pytest.fixture
def built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose environment looks freshly built."""
    monkeypatch.delenv("PYTHON", raising=False)
    for name, path in {"ROOT": "", "VENV": ".venv", "STAMP": ".venv/stereolib.stamp"}.items():
        monkeypatch.setattr(bootstrap, name, tmp_path / path)
    for name in ("requirements.txt", "pyproject.toml"):
        (tmp_path / name).write_text(name)
    python = bootstrap.venv_python()
    python.parent.mkdir(parents=True)
    python.touch()
    version = "{}.{}".format(*sys.version_info)
    bootstrap.STAMP.write_text(f"{bootstrap.fingerprint()} {version}\n")
    return tmp_path


def test_fresh_environment_is_left_alone(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def must_not_run(*arguments: object, **options: object) -> None:
        raise AssertionError(arguments)

    monkeypatch.setattr(bootstrap.subprocess, "Popen", must_not_run)
    bootstrap.setup()
    assert bootstrap.is_fresh()


@pytest.mark.parametrize("name", ["requirements.txt", "pyproject.toml"])
def test_changed_pins_make_it_stale(built: Path, name: str) -> None:
    (built / name).write_text("changed")
    assert not bootstrap.is_fresh()


def test_moved_folder_missing_python_and_other_python_make_it_stale(
    built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHON", "python3")
    assert bootstrap.is_fresh()  # asked for the Python that it has
    monkeypatch.setattr(sys, "version_info", (3, 99, 0))
    assert not bootstrap.is_fresh()
    monkeypatch.delenv("PYTHON")
    assert bootstrap.is_fresh()  # asked for none in particular
    bootstrap.venv_python().unlink()
    assert not bootstrap.is_fresh()
    bootstrap.venv_python().touch()
    monkeypatch.setattr(bootstrap, "ROOT", built / ".." / built.name)
    assert not bootstrap.is_fresh()


def test_unknown_command_shows_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert bootstrap.main(["nonsense"]) == 2
    assert "no command 'nonsense'" in capsys.readouterr().err
    assert bootstrap.main([]) == 0
    assert "make reproduce" in capsys.readouterr().out
