#!/usr/bin/env python3
"""Writes the one block of a language of a page to a file: take_block.py PAGE LANGUAGE OUT. Compilers report errors at the line of the page."""
import pathlib
import re
import sys

page, language, out = sys.argv[1:4]
text = pathlib.Path(page).read_text(encoding="utf-8")
(block,) = re.finditer(rf"^```{language}\n(.*?)^```$", text, re.M | re.S)
pathlib.Path(out).write_text(f'#line {text.count(chr(10), 0, block.start(1)) + 1} "{page}"\n{block.group(1)}', encoding="utf-8")
