"""Word list of the project's language: ``python -m tests.language`` names every line that has one.

The words are those that made the text hard to read; `CONTRIBUTING.md` says what to write instead.
"""

import re
import subprocess
import sys
from pathlib import Path

PATTERN = re.compile(
    r"\b(she|her|hers|herself|foretold|foretells?|reckon(s|ed)?|whoever|ashore|aboard|likewise"
    r"|beforehand|awash|lively|livelier|liveliest|(told|tells?) (of|apart)|believed|anew|amiss"
    r"|whence|wherein|thereof|forthwith|last words|costs? nothing|stands? in the"
    r"|hears?|heard|obeys?|obeyed|says so|the message says|taught|patience)\b",
    re.IGNORECASE,
)
CHECKED = ("*.py", "*.md", "*.toml", "Makefile")
EXEMPT = ("tests/language.py",)


def main() -> int:
    """Print every line with a listed word, and return 1 if there is one."""
    listed = subprocess.run(
        ["git", "ls-files", *CHECKED], capture_output=True, text=True, check=True
    )
    found = [
        f"{name}:{number}: {match[0]}: {line.strip()}"
        for name in listed.stdout.split()
        if name not in EXEMPT
        for number, line in enumerate(Path(name).read_text(encoding="utf-8").splitlines(), 1)
        if (match := PATTERN.search(line))
    ]
    print("\n".join(found) or "language: no listed word")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
