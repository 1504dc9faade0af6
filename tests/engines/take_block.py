#!/usr/bin/env python3
"""Writes the blocks of a language of a page to files: take_block.py PAGE LANGUAGE OUT. The first block goes to OUT, the second to OUT with a 2 before
its suffix, and so on. Compilers report errors at the line of the page."""
import pathlib
import re
import sys

page, language, out = sys.argv[1:4]
text = pathlib.Path(page).read_text(encoding="utf-8")
blocks = list(re.finditer(rf"^```{language}\n(.*?)^```$", text, re.M | re.S))
assert blocks, f"{page} has no block of {language}"
for number, block in enumerate(blocks, 1):
    file = pathlib.Path(out)
    if number > 1:
        file = file.with_name(f"{file.stem}{number}{file.suffix}")
    file.write_text(f'#line {text.count(chr(10), 0, block.start(1)) + 1} "{page}"\n{block.group(1)}', encoding="utf-8")
