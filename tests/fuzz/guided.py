"""Coverage-guided damage with atheris: ``make fuzz-guided`` (needs the extra ``fuzz``).

    python tests/fuzz/guided.py DIALECT SECONDS CORPUS [further options of libFuzzer]

Begins with generated programs and the samples of the tests, writes what reaches new lines to
CORPUS, and ends with a file ``crash-*`` there if a law is broken. Compiled kernels are run, but
guide nothing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import atheris

ROOT = Path(__file__).parents[2] / "src" / "robotrue"


def left_alone() -> list[str]:
    """Modules outside the room of programs, and those numba compiles from their byte code."""
    out = []
    for path in ROOT.rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        text = path.read_text(encoding="utf-8")
        if parts[0] != "program" or "njit" in text or "@compile_kernel" in text:
            out.append(".".join(("robotrue", *(part for part in parts if part != "__init__"))))
    return out


with atheris.instrument_imports(include=["robotrue"], exclude=left_alone()):
    from languages import LANGUAGES, frames_of
    from laws import survives, warm
    from written import Pen

    for path in (ROOT / "program" / "formats").glob("*.py"):  # some are imported when first used
        import_module(f"robotrue.program.formats.{path.stem}")

SEEDS = 150
LIMIT = 10.0


def seeded(name: str, corpus: Path) -> Path:
    """Fills the folder with whole programs and returns the dictionary of the language beside it."""
    language = LANGUAGES[name]
    corpus.mkdir(parents=True, exist_ok=True)
    (corpus / "sample").write_bytes(language.sample)
    for k in range(SEEDS):
        (corpus / f"written{k}").write_bytes(language.writer(Pen.of([5, k])).files[0][1])
    words = corpus.parent / f"{name}.dict"
    escaped = ["".join(f"\\x{byte:02x}" for byte in piece) for piece in language.pieces if piece]
    words.write_text("".join(f'"{text}"\n' for text in dict.fromkeys(escaped)))
    return words


def main() -> None:
    """Runs until the time is up or a law is broken."""
    name, seconds, corpus = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])
    words = seeded(name, corpus)
    warm(name)
    file = LANGUAGES[name].name
    count = 0

    def one(data: bytes) -> None:
        nonlocal count
        count += 1
        survives(name, ((file, data),), frames_of(name), count, LIMIT)

    options = [
        f"-max_total_time={seconds}", "-max_len=20000", "-timeout=60", "-rss_limit_mb=3000",
        f"-dict={words}", f"-artifact_prefix={corpus}/", "-print_final_stats=1",
    ]  # fmt: skip
    atheris.Setup([sys.argv[0], str(corpus), *options, *sys.argv[4:]], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
