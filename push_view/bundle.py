"""The page's JavaScript modules as one script, for a file that is opened without a server."""

import re
from pathlib import Path

_PAGE = Path(__file__).parent / "page"
_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./(\w+)\.js";\n', re.M)
_EXPORT = re.compile(r"^export (?:async )?(?:const|let|function|class) (\w+)", re.M)


def bundle(entry: str) -> str:
    """The module of a name and all that it imports; what it exports is in ``modules[name]``.

    Only what the modules of this project use is known: named imports on one line, and exports of
    declarations.
    """
    done: dict[str, str] = {}
    _add(entry, done)
    return "const modules = {};\n" + "\n".join(done.values())


def _add(name: str, done: dict[str, str]) -> None:
    if name in done:
        return
    text = (_PAGE / f"{name}.js").read_text(encoding="utf-8")
    for _, other in _IMPORT.findall(text):
        _add(other, done)
    exports = ", ".join(_EXPORT.findall(text))
    text = _IMPORT.sub(r"const {\1} = modules.\2;\n", text)
    text = re.sub(r"^export ", "", text, flags=re.M)
    done[name] = f"modules.{name} = (() => {{\n{text}\nreturn {{{exports}}};\n}})();"
