"""The Python example of the README runs and prints a time and the number of active taxels."""

import re
from pathlib import Path

import pytest

README = Path(__file__).parents[3] / "README.md"


def test_the_readme_example_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)
    exec(compile(block, str(README), "exec"), {})
    # The example prints the time of one scan and its number of active taxels; nothing touches the emulated skin.
    time_s, active = capsys.readouterr().out.split()
    assert float(time_s) > 0.0
    assert active == "0"
