"""Find the words that the glossary replaces: in names, comments, docstrings, messages and pages.

python tools/wording/check_terms.py               every tracked file (make lint)
python tools/wording/check_terms.py PATH ...      only these files and folders
python tools/wording/check_terms.py --counts      findings by word and by folder
"""

import argparse
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from texts import NAME, extract_texts

ROOT: Final = Path(__file__).resolve().parents[2]
TERMS: Final = Path(__file__).with_name("terms.toml")
ALLOWED: Final = Path(__file__).with_name("allowed.toml")


class Finding(NamedTuple):
    """A word that the glossary replaces."""

    path: str
    line: int
    word: str
    instead: str
    text: str


@dataclass(frozen=True, eq=False)
class Term:
    """A word of the glossary's left column.

    name: matches a part of a name (between underscores or at a capital letter), or None. whole: matches a complete
    name, or None. prose: matches in prose, or None. paths: the files in which the word has the forbidden meaning.
    """

    word: str
    instead: str
    name: re.Pattern[str] | None
    whole: re.Pattern[str] | None
    prose: re.Pattern[str] | None
    paths: tuple[str, ...]

    def matches(self, kind: str, text: str) -> Iterator[str]:
        """Yield the forbidden words in `text`. kind: `NAME` or `PROSE`; a forbidden name is yielded as a whole."""
        if kind == NAME:
            if (self.whole is not None and self.whole.fullmatch(text)) or (
                self.name is not None and any(self.name.fullmatch(part) for part in split_name(text))
            ):
                yield text
        elif self.prose is not None:
            yield from (match[0] for match in self.prose.finditer(text))


@dataclass(frozen=True)
class Exception_:  # noqa: N801 - an entry of allowed.toml, not an error
    """An exception with its reason: words and names that a pattern matches, in files that a pattern matches."""

    path: str
    word: str
    text: re.Pattern[str] | None
    reason: str

    def covers(self, finding: Finding) -> bool:
        """Return whether the exception applies to a finding."""
        return (
            fnmatch(finding.path, self.path)
            and self.word in ("*", finding.word)
            and (self.text is None or self.text.search(finding.text) is not None)
        )


_STEM: Final = re.compile(r"[a-z]{3,}")


def list_stems(term: Term) -> tuple[str, ...]:
    """Return beginnings of words of which one must occur in any prose that the term matches.

    Returns () if the term's pattern has no letters. Escapes and optional letters are ignored: `rooms?` has the stem
    `room`.
    """
    source = re.sub(r"\w\?", "", re.sub(r"\\.", " ", term.prose.pattern)) if term.prose is not None else ""
    return tuple(_STEM.findall(source.lower()))


class Prefilter:
    """Quick selection of the few terms that the prose of a file can contain, from the words of the file."""

    def __init__(self, terms: Sequence[Term]) -> None:
        """Collect the stems of the terms. terms: of all files."""
        self._stems = {term: list_stems(term) for term in terms if term.prose is not None}
        self._terms_of_words: dict[str, frozenset[Term]] = {}

    def select(self, content: str) -> set[Term]:
        """Return the terms with a stem that begins a word of a file, and those without stems.

        content: text of the file.
        """
        selected = {term for term, stems in self._stems.items() if not stems}
        for word in set(_STEM.findall(content.lower())):
            if word not in self._terms_of_words:
                self._terms_of_words[word] = frozenset(
                    term for term, stems in self._stems.items() if word.startswith(stems)
                )
            selected |= self._terms_of_words[word]
        return selected


@cache
def split_name(name: str) -> tuple[str, ...]:
    """Return the words of a name in lower case: `signal_counts` and `SignalCounts` have two."""
    return tuple(part.lower() for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name))


def read_terms(path: Path = TERMS) -> list[Term]:
    """Read the terms of `terms.toml`. Raises KeyError for an entry without word or replacement."""
    entries = tomllib.loads(path.read_text())["term"]
    return [
        Term(
            entry["word"],
            entry["instead"],
            _pattern(entry, "name"),
            _pattern(entry, "whole"),
            _pattern(entry, "prose"),
            tuple(entry.get("paths", ["*"])),
        )
        for entry in entries
    ]


def _pattern(entry: Mapping[str, Any], key: str) -> re.Pattern[str] | None:
    """Return the regular expression under `key` in an entry of terms.toml, which ignores case; None without the key."""
    return re.compile(entry[key], re.IGNORECASE) if key in entry else None


def read_exceptions(path: Path = ALLOWED) -> list[Exception_]:
    """Read the exceptions of `allowed.toml`. Raises KeyError for an entry without a reason."""
    entries = tomllib.loads(path.read_text())["allowed"]
    return [
        Exception_(
            glob, entry.get("word", "*"), re.compile(entry["text"]) if "text" in entry else None, entry["reason"]
        )
        for entry in entries
        for glob in entry["paths"]
    ]


def list_tracked_files(arguments: Sequence[str]) -> list[str]:
    """Return the files that git tracks or would track below the given paths, sorted; without a path all of them."""
    command = ["git", "-C", str(ROOT), "ls-files", "--cached", "--others", "--exclude-standard", "--", *arguments]
    names = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split("\n")
    return sorted({name for name in names if name and (ROOT / name).is_file()})


class Search:
    """Search for forbidden words in files, which remembers the words and names of earlier files."""

    def __init__(self, terms: Sequence[Term]) -> None:
        """Prepare the search. terms: all terms of terms.toml."""
        self._terms = terms
        self._prefilter = Prefilter(terms)
        self._whole_terms = [term for term in terms if term.whole is not None]
        self._terms_of_parts: dict[str, set[Term]] = {}
        self._terms_of_names: dict[str, set[Term]] = {}

    def find_terms_of_name(self, name: str) -> set[Term]:
        """Return the terms that forbid a name or a word of the name."""
        if name not in self._terms_of_names:
            found = {term for term in self._whole_terms if any(term.matches(NAME, name))}
            for part in split_name(name):
                if part not in self._terms_of_parts:
                    self._terms_of_parts[part] = {term for term in self._terms if any(term.matches(NAME, part))}
                found |= self._terms_of_parts[part]
            self._terms_of_names[name] = {term for term in found if any(term.matches(NAME, name))}
        return self._terms_of_names[name]

    def findings_in(self, path: str, content: str) -> Iterator[Finding]:
        """Yield all forbidden words of a file; exceptions are not yet considered.

        path: relative to the repository. content: text of the file.
        """
        applicable = [term for term in self._terms if any(fnmatch(path, glob) for glob in term.paths)]
        possible = self._prefilter.select(content)
        in_prose = [term for term in applicable if term in possible]
        names: set[str] = set()

        def is_suspicious(name: str) -> bool:
            """Return whether a term applies to a name in this file."""
            return any(term in applicable for term in self.find_terms_of_name(name))

        for kind, line, text in extract_texts(Path(path), content, is_suspicious):
            if kind == NAME and text in names:
                continue  # a name is reported once in a file
            candidates = in_prose
            if kind == NAME:
                names.add(text)
                candidates = [term for term in self.find_terms_of_name(text) if term in applicable]
            for term in candidates:
                for match in term.matches(kind, text):
                    yield Finding(path, line, term.word, term.instead, match if kind == NAME else text.strip())
                    break


def main() -> int:
    """Print the findings and the unused exceptions; the exit status is 1 if there are any."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("paths", nargs="*", help="files and folders (default: all)")
    parser.add_argument("--counts", action="store_true", help="print counts by word and folder only")
    arguments = parser.parse_args()
    terms, exceptions = read_terms(), read_exceptions()
    findings: list[Finding] = []
    used: Counter[int] = Counter()
    search = Search(terms)
    for name in list_tracked_files(arguments.paths):
        try:
            content = (ROOT / name).read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # a binary file
        for finding in search.findings_in(name, content):
            covering = [index for index, exception in enumerate(exceptions) if exception.covers(finding)]
            used.update(covering)
            if not covering:
                findings.append(finding)
    if arguments.counts:
        by_folder = Counter((finding.word, "/".join(finding.path.split("/")[:3])) for finding in findings)
        for (word, folder), count in sorted(by_folder.items(), key=lambda item: -item[1]):
            print(f"{count:5} {word:12} {folder}")
    else:
        for finding in findings:
            print(f"{finding.path}:{finding.line}: '{finding.word}' in: {finding.text[:100]} -> {finding.instead}")
    unused = [exceptions[i] for i in range(len(exceptions)) if not used[i]] if not arguments.paths else []
    for exception in unused:
        print(f"tools/wording/allowed.toml: nothing needs the exception {exception.path} '{exception.word}'; remove it")
    print(f"terms: {len(findings)} findings", file=sys.stderr)
    return 1 if findings or unused else 0


if __name__ == "__main__":
    sys.exit(main())
