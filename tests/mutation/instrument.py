"""Finds the mutants of a C++ source, and renders a text that contains all of them, each behind a switch (switch.h).

What is mutated: comparisons (of whole numbers at their bounds, of others negated), arithmetic, conditions of `if` and `?:`, operands of
&& and ||, whole numbers and truth values, signs, std::min and std::max, and expression statements, which are left out. What is not:
headers, constant expressions, log lines, assertions and reserved memory, and real numbers: with another one, most often, a camera is as
right as before. A mutant that does not compile is dropped.
"""
import collections
import pathlib
import re
import sys

import clang.cindex as clang
from clang.cindex import CursorKind as Kind
from clang.cindex import TypeKind

# #line keeps the source's own line numbers.
HEAD = b'#include "tests/mutation/switch.h"\n#line 1\n'
Edit = collections.namedtuple("Edit", "at until order text")  # replaces source[at:until]; `order` sorts edits at one place
COMPARISONS = {"<": "less", "<=": "less_equal", ">": "greater", ">=": "greater_equal"}
ARITHMETIC = {"+": "add", "-": "subtract", "*": "multiply", "/": "divide"}
WHOLE = {TypeKind.CHAR_U, TypeKind.UCHAR, TypeKind.CHAR16, TypeKind.CHAR32, TypeKind.USHORT, TypeKind.UINT, TypeKind.ULONG, TypeKind.ULONGLONG,
         TypeKind.CHAR_S, TypeKind.SCHAR, TypeKind.SHORT, TypeKind.INT, TypeKind.LONG, TypeKind.LONGLONG}
REAL = {TypeKind.FLOAT, TypeKind.DOUBLE, TypeKind.LONGDOUBLE}
# Statements whose absence no test should notice.
UNTESTED = re.compile(rb"^\s*(\(void\)|assert\(|[\w.>-]*\blog(_|\(\))?\.|[\w.>-]*reserve\(|std::fputs|std::fprintf|std::cerr|spdlog)")


PREAMBLE_AT_ONCE = 0x100  # CXTranslationUnit_CreatePreambleOnFirstParse, which the module lacks
LONGEST_TEXT = 120  # characters of a mutant's text that are kept


class Mutant:
    def __init__(self, kind, at, until, edits, change, constant=None):
        self.kind, self.at, self.until, self.edits, self.change, self.constant = kind, at, until, edits, change, constant
        self.ordinal = 1  # among the mutants of its file with the same change and text


class Source:
    """One file: finds its mutants and renders the text that contains them."""

    def __init__(self, path, arguments):
        self.path, self.arguments = str(path), arguments
        self.text = HEAD + pathlib.Path(path).read_bytes()
        self.mutants = []
        self.unit = None
        self.constants = {}  # name: place of its `constexpr`
        self.headers = []    # paths of all files that it includes

    def find(self):
        """Finds the mutants. Returns what clang says against the source."""
        # The included headers are read once.
        self.unit = clang.Index.create().parse(self.path, self.arguments, unsaved_files=[(self.path, self.text.decode())],
                                               options=clang.TranslationUnit.PARSE_PRECOMPILED_PREAMBLE | PREAMBLE_AT_ONCE)
        self.headers = sorted({found.include.name for found in self.unit.get_includes()})
        if errors := self.errors():
            return errors
        for child in self.unit.cursor.get_children():
            if child.location.file and child.location.file.name == self.path:
                self.visit(child, 0, None)
        self.prune()
        self.number_equal_ones()
        return []

    def errors_of(self, text):
        self.unit.reparse(unsaved_files=[(self.path, text.decode())])
        return self.errors()

    def errors(self):
        return [d for d in self.unit.diagnostics if d.severity >= clang.Diagnostic.Error]

    # --- walking

    def visit(self, cursor, depth, constant):
        start, end = cursor.extent.start.offset, cursor.extent.end.offset
        kind = cursor.kind
        if kind == Kind.STATIC_ASSERT or kind == Kind.ENUM_DECL:
            return
        if kind == Kind.VAR_DECL:
            constant = self.constant_of(cursor, start)
        children = list(cursor.get_children())
        handler = {Kind.BINARY_OPERATOR: self.binary, Kind.CALL_EXPR: self.call, Kind.IF_STMT: self.condition_of_if,
                   Kind.CONDITIONAL_OPERATOR: self.condition_of_choice, Kind.UNARY_OPERATOR: self.unary,
                   Kind.INTEGER_LITERAL: self.number, Kind.CXX_BOOL_LITERAL_EXPR: self.truth}.get(kind)
        if handler and constant != "":
            handler(children, start, end, depth, constant, cursor)
        if kind == Kind.COMPOUND_STMT:
            for child in children:
                self.statement(child, depth)
        elif kind in (Kind.IF_STMT, Kind.FOR_STMT, Kind.WHILE_STMT, Kind.CXX_FOR_RANGE_STMT):
            for child in children:
                if re.search(rb"(\)|\belse)\s*$", self.text[max(0, child.extent.start.offset - 200):child.extent.start.offset]):
                    self.statement(child, depth)
        for child in children:
            if child.location.file and child.location.file.name == self.path:
                self.visit(child, depth + 1, constant)

    def constant_of(self, cursor, start):
        """The name of a constant whose `constexpr` may become `const`; "" for one that must stay; None for other variables."""
        head = self.text[start:cursor.location.offset]
        if b"constexpr" not in head:
            return None
        at_namespace = cursor.semantic_parent.kind in (Kind.NAMESPACE, Kind.TRANSLATION_UNIT)
        if not at_namespace or b"inline" in head:
            return ""
        self.constants[cursor.spelling] = start + head.index(b"constexpr")
        return cursor.spelling

    # --- kinds

    def add(self, kind, start, end, edits, change, constant):
        if b"\n#" in self.text[start:end]:  # no preprocessor lines inside
            return
        self.mutants.append(Mutant(kind, start, end, edits, change, constant))

    def wrap(self, start, end, depth, before, after=")"):
        return [Edit(start, start, (1, depth), before), Edit(end, end, (0, -depth), after)]

    def operator(self, children):
        """Place and text of the operator between two operands."""
        between = self.text[children[0].extent.end.offset:children[1].extent.start.offset]
        found = re.match(rb"\s*(<=>|<=|>=|==|!=|&&|\|\||[<>+\-*/%=&|^])\s*(?:/[/*].*)?$", between, re.S)
        if not found or b"//" in between:
            return None, ""
        return children[0].extent.end.offset + found.start(1), found.group(1).decode()

    def binary(self, children, start, end, depth, constant, cursor):
        if len(children) != 2:
            return
        at, operator = self.operator(children)
        kinds = [child.type.get_canonical().kind for child in children]
        if operator in ("==", "!="):
            return self.add("comparison", start, end, self.wrap(start, end, depth, "mutation::negate(@, "), f"not ({operator})", constant)
        if operator in ("&&", "||"):
            skip = "(mutation::on(@) || static_cast<bool>(" if operator == "&&" else "(!mutation::on(@) && static_cast<bool>("
            for child in children:
                edits = self.wrap(child.extent.start.offset, child.extent.end.offset, depth, skip, "))")
                self.add("operand", child.extent.start.offset, child.extent.end.offset, edits, f"no operand of {operator}", constant)
        elif operator in COMPARISONS:
            if all(kind in WHOLE for kind in kinds):
                self.two(start, end, at, operator, depth, COMPARISONS[operator], "comparison", constant)
            else:
                self.add("comparison", start, end, self.wrap(start, end, depth, "mutation::negate(@, "), f"not ({operator})", constant)
        elif operator in ARITHMETIC and all(kind in WHOLE | REAL for kind in kinds):
            self.two(start, end, at, operator, depth, ARITHMETIC[operator], "arithmetic", constant)

    def two(self, start, end, at, operator, depth, name, kind, constant):
        edits = self.wrap(start, end, depth, f"mutation::{name}(@, ") + [Edit(at, at + len(operator), (2, 0), ", ")]
        change = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "+": "-", "-": "+", "*": "/", "/": "*"}[operator]
        self.add(kind, start, end, edits, f"{operator} -> {change}", constant)

    def call(self, children, start, end, depth, constant, cursor):
        text = self.text[start:end]
        if text.startswith((b"std::min(", b"std::max(")) and not text.startswith((b"std::min({", b"std::max({")):
            name = text[5:8].decode()
            change = {"min": "min -> max", "max": "max -> min"}[name]
            return self.add("extreme", start, end, [Edit(start, start + 9, (1, depth), f"mutation::{name}(@, ")], change, constant)
        if cursor.spelling in ("operator==", "operator!=") and len(children) == 3:
            self.add("comparison", start, end, self.wrap(start, end, depth, "mutation::negate(@, "), "negated", constant)
        elif cursor.spelling in ("operator+", "operator-") and len(children) == 3 and "vec" in cursor.type.get_canonical().spelling:
            at, operator = self.operator([children[0], children[2]])
            if operator in ("+", "-"):
                self.two(start, end, at, operator, depth, ARITHMETIC[operator], "arithmetic", constant)
        elif cursor.spelling == "operator-" and len(children) == 2 and text.startswith(b"-"):
            self.sign(start, end, depth, constant)

    def unary(self, children, start, end, depth, constant, cursor):
        if self.text[start:start + 1] == b"-" and self.text[start + 1:start + 2] != b"-" and children and \
                children[0].kind not in (Kind.INTEGER_LITERAL, Kind.FLOATING_LITERAL):
            self.sign(start, end, depth, constant)

    def sign(self, start, end, depth, constant):
        edits = [Edit(start, start + 1, (1, depth), "mutation::minus(@, "), Edit(end, end, (0, -depth), ")")]
        self.add("sign", start, end, edits, "no minus", constant)

    def condition_of_choice(self, children, start, end, depth, constant, cursor):
        self.condition(children[0].extent.start.offset, children[0].extent.end.offset, depth, children[0])

    def condition_of_if(self, children, start, end, depth, constant, cursor):
        """The text in the parentheses of `if`, after an initialisation."""
        opening = re.match(rb"if\s*\(", self.text[start:])
        if not opening:
            return
        at = begin = start + opening.end()
        level = 1
        while level:
            if at >= end:
                return  # a parenthesis in a literal confuses the count
            letter = self.text[at:at + 1]
            level += (letter in b"([{") - (letter in b")]}")
            if letter == b";" and level == 1:
                begin = at + 1
            at += 1
        conditions = [child for child in children if child.extent.start.offset >= begin and child.extent.end.offset <= at - 1]
        if len(conditions) == 1 and conditions[0].kind.is_expression():
            self.condition(conditions[0].extent.start.offset, conditions[0].extent.end.offset, depth, conditions[0])

    def condition(self, start, end, depth, cursor):
        inner = cursor
        while inner.kind == Kind.UNEXPOSED_EXPR and len(list(inner.get_children())) == 1:
            inner = next(inner.get_children())
        if inner.kind == Kind.BINARY_OPERATOR and len(list(inner.get_children())) == 2:
            children = list(inner.get_children())
            operator = self.operator(children)[1]
            whole = all(child.type.get_canonical().kind in WHOLE for child in children)
            if operator in ("==", "!=") or operator in COMPARISONS and not whole:
                return  # is negated as a comparison
        # Outside what else begins here.
        self.add("condition", start, end, self.wrap(start, end, depth, "mutation::negate(@, static_cast<bool>(", "))"), "negated", None)

    def number(self, children, start, end, depth, constant, cursor):
        text = self.text[start:end].decode()
        if re.fullmatch(r"[0-9][0-9a-fA-FxX']*[uUlLzZ]*", text):
            edits = [Edit(start, end, (1, depth), f"(mutation::on(@) ? {text} + 1 : {text})")]
            self.add("number", start, end, edits, f"{text} -> {text} + 1", constant)

    def truth(self, children, start, end, depth, constant, cursor):
        text = self.text[start:end]
        if text in (b"true", b"false"):
            self.add("truth", start, end, [Edit(start, end, (1, depth), f"mutation::negate(@, {text.decode()})")], "negated", constant)

    def statement(self, cursor, depth):
        if not cursor.kind.is_expression() or not cursor.location.file or cursor.location.file.name != self.path:
            return
        start, end = cursor.extent.start.offset, cursor.extent.end.offset
        rest = re.match(rb"\s*;", self.text[end:])
        if not rest or UNTESTED.match(self.text[start:end]) or cursor.kind == Kind.CXX_THROW_EXPR:
            return
        end += rest.end()
        edits = [Edit(start, start, (1, depth - 1), "{ if (!mutation::on(@)) "), Edit(end, end, (0, -depth), " }")]
        self.add("statement", start, end, edits, "left out", None)

    # --- writing

    def prune(self):
        """Drops mutants inside of what is not tested, and those that change the same text in the same way."""
        for found in re.finditer(rb"(?m)^[ \t]*", self.text):
            if UNTESTED.match(self.text[found.start():found.start() + 300]):
                end = self.text.find(b";", found.end())
                self.mutants = [m for m in self.mutants if not found.start() <= m.at < end]
        seen = set()
        self.mutants = [m for m in self.mutants if not ((key := (m.at, m.until, m.kind)) in seen or seen.add(key))]

    def number_equal_ones(self):
        """What does not compile is dropped after this, so that no compiler changes the ordinals."""
        seen = collections.Counter()
        for mutant in sorted(self.mutants, key=lambda mutant: (mutant.at, mutant.until)):
            seen[mutant.change, self.text_of(mutant)] += 1
            mutant.ordinal = seen[mutant.change, self.text_of(mutant)]

    def original(self):
        """The text of the file itself."""
        return self.text[len(HEAD):].decode()

    def text_of(self, mutant):
        return " ".join(self.text[mutant.at:mutant.until].decode(errors="replace").split())[:LONGEST_TEXT]

    def lines_of(self, mutant):
        """The first and the last line, as the source counts them."""
        return [self.text.count(b"\n", 0, place) + 1 - HEAD.count(b"\n") for place in (mutant.at, mutant.until)]

    def render(self, first):
        """The text with all mutants, numbered from `first`, and the places in it where each mutant begins and ends."""
        edits = []
        for number, mutant in enumerate(self.mutants):
            edits += [(e.at, e.until, e.order, number, e.text.replace("@", str(first + number))) for e in mutant.edits]
        for at in {self.constants[m.constant] for m in self.mutants if m.constant}:
            edits.append((at, at + len("constexpr"), (1, 0), -1, "const"))
        edits.sort(key=lambda e: (e[0], e[1] > e[0], e[2]))
        out, position, spans = [], 0, collections.defaultdict(list)
        length = 0
        for at, until, _, number, text in edits:
            if at < position:
                raise ValueError(f"{self.path}: changes overlap at {at}")
            piece = self.text[position:at] + text.encode()
            out.append(piece)
            length += len(piece)
            spans[number].append(length)
            position = until
        out.append(self.text[position:])
        return b"".join(out), {number: (min(places), max(places)) for number, places in spans.items()}

    def compile_out(self):
        """Drops what does not compile; all mutants of the file, when that does not help."""
        errors = []
        for _ in range(12):
            text, spans = self.render(0)
            errors = self.errors_of(text)
            if not errors:
                return
            wrong, constants = set(), set()
            for error in errors:
                told = " ".join([error.spelling] + [child.spelling for child in error.children])
                named = {self.constants[name] for name in self.constants if f"'{name}'" in told}
                constants |= {name for name, place in self.constants.items() if place in named}
                places = [e.location.offset for e in [error, *error.children] if e.location.file and e.location.file.name == self.path]
                for place in places:
                    inside = [n for n, (low, high) in spans.items() if n >= 0 and low - 60 <= place <= high + 2]
                    if inside:
                        wrong.add(min(inside, key=lambda n: spans[n][1] - spans[n][0]))
            kept = [m for n, m in enumerate(self.mutants) if n not in wrong and m.constant not in constants]
            if len(kept) == len(self.mutants):
                break
            self.mutants = kept
        print(f"{self.path}: left as it is: {errors[0]}", file=sys.stderr)
        self.mutants = []
