#!/usr/bin/env python3
"""What is made of the flags of the programs: command_line.py OUT PROGRAM...

Each program tells its flags and sub-commands by --describe. Written below OUT:

    COMMAND_LINE.md          the page about all flags
    man/NAME.SECTION.gz      a manual page for each program
    completions/{bash,zsh,fish}/    completions for shells
"""
import gzip
import json
import pathlib
import re
import subprocess
import sys

SECTIONS = {"sightlined": 8}  # daemons; other programs are in section 1
MOST_IN_LINE = 8  # choices; more of them stand in the text
EXIT_STATUS = "0: the work was done. 1: the work failed, or the answer is no. 2: the flags are wrong."


class Flag:
    def __init__(self, table):
        self.names, self.choices, self.takes_value = table["names"], table["choices"], table["takes_value"]
        self.text = table["description"].rstrip(".")
        if len(self.choices) > MOST_IN_LINE:
            self.text += ". One of " + ", ".join(self.choices)
        self.positional, self.required, self.repeated = table["positional"], table["required"], table["repeated"]
        self.default, self.type = table["default"], table["type"]

    @property
    def value(self):
        """What may follow the flag: "a|b", "0 to 5", "FILE"; "" for a switch."""
        if not self.takes_value:
            return ""
        if self.choices:
            return "|".join(self.choices) if len(self.choices) <= MOST_IN_LINE else "NAME"
        if self.type.endswith(":NONNEGATIVE"):
            return "0 or more"
        interval = re.search(r"in \[(\S+) - (\S+)\]|NUMBER (\S+) to (\S+)", self.type)
        if interval:
            low, high = filter(None, interval.groups())
            return f"{low} to {high}"
        return self.type.split(":", 1)[-1] if self.type.startswith(("TEXT:", "PATH:")) else self.type or "TEXT"

    @property
    def default_text(self):
        return self.default.strip('"') if self.takes_value else ""

    @property
    def is_file(self):
        return re.search(r"\b(FILE|PATH|DIR|PATH\(existing\))", self.type) is not None or self.positional


class Command:
    def __init__(self, table, parent=None):
        self.name, self.text = table["name"], table["description"].rstrip(".")
        self.footer = table["footer"].strip("\n")
        self.flags = [Flag(flag) for flag in table["flags"]]
        self.parent = parent if table["takes_flags_of_parent"] else None
        self.commands = [Command(command, self) for command in table["commands"]]

    @property
    def all_flags(self):
        own = {name for flag in self.flags for name in flag.names}
        return self.flags + [flag for flag in (self.parent.flags if self.parent else []) if not own & set(flag.names)]

    @property
    def switches(self):
        return [flag for flag in self.all_flags if not flag.positional]

    @property
    def arguments(self):
        return [flag for flag in self.flags if flag.positional]

    def usage(self, program):
        words = [program] if program == self.name else [program, self.name]
        words += [(flag.names[0].upper() + ("..." if flag.repeated else "")) if flag.required else f"[{flag.names[0].upper()}]"
                  for flag in self.arguments]
        return " ".join(words + ["[flags]"])


def first_sentence(text):
    return re.split(r"(?<=[a-z)])\. ", text)[0].rstrip(".")


# ---- the page

def flag_rows(command):
    for flag in command.flags:
        if flag.names[0] == "--help":
            continue
        names = ", ".join(f"`{name}`" for name in flag.names)
        notes = [word for word, holds in (("required", flag.required), ("repeatable", flag.repeated and "repeated" not in flag.text)) if holds]
        value = flag.value.replace("|", " \\| ")
        text = flag.text.replace("|", "\\|") + "." + (f" ({', '.join(notes)})" if notes else "")
        yield f"| {names} | {value} | {flag.default_text.replace('|', chr(92) + '|')} | {text} |"


def flag_table(command):
    rows = list(flag_rows(command))
    return "\n".join(["| flag | value | default | what it does |", "|---|---|---|---|", *rows]) + "\n" if rows else ""


def page(programs):
    parts = ["# Command line and configuration\n\n"
             "Generated from the programs' own tables of flags; a test keeps this page current. `--help` prints the same. The manual pages and the\n"
             "completions for bash, zsh and fish, which the package installs, come from these tables too. `--describe` prints them as JSON.\n\n"
             f"Exit status of both programs. {EXIT_STATUS}\n\n"
             "Every flag of `sightlined` can also stand in a file that `--config` names, without its dashes: `max-sessions=64`.\n"
             "A value may stand in single or double quotes, and must if it holds a `#`, which begins a comment. A value holds no line break, and not both kinds of quotes.\n"
             "`sightlined --print-config` prints such a file, and `--check-config` checks one. Flags on the command line win.\n"]
    for program in programs:
        parts.append(f"## {program.name}\n\n{program.text}.\n\n{flag_table(program)}")
        for command in program.commands:
            parts.append(f"### {program.name} {command.name}\n\n{command.text}.\n\n{flag_table(command)}")
    return "\n".join(parts)


# ---- manual pages

def roff(text):
    lines = text.replace("\\", "\\e").replace("-", "\\-").splitlines()
    return "\n".join("\\&" + line if line.startswith((".", "'")) else line for line in lines)


def roff_flags(flags):
    for flag in flags:
        value = f" \\fI{roff(flag.value)}\\fR" if flag.value and not flag.positional else ""
        names = ", ".join(f"\\fB{roff(name)}\\fR" for name in flag.names)
        default = f" Default: {roff(flag.default_text)}." if flag.default_text else ""
        yield f".TP\n{names}{value}\n{roff(flag.text)}.{default}"


def manual(program, version, others):
    section = SECTIONS.get(program.name, 1)
    lines = [f'.TH {program.name.upper()} {section} "" "{program.name} {version}" "Sightline"',
             ".SH NAME", f"{program.name} \\- {roff(first_sentence(program.text)[0].lower() + first_sentence(program.text)[1:])}",
             ".SH SYNOPSIS", f".B {roff(program.usage(program.name))}"]
    lines += [f".br\n.B {roff(command.usage(program.name))}" for command in program.commands]
    lines += [".SH DESCRIPTION", roff(program.text) + ".", ".SH OPTIONS", *roff_flags(program.flags)]
    if program.commands:
        lines.append(".SH COMMANDS")
    for command in program.commands:
        lines += [f".SS {roff(command.name)}", roff(command.text) + ".", *roff_flags(f for f in command.flags if f.names[0] != "--help")]
        if command.footer:
            lines += [".PP", ".nf", roff(command.footer), ".fi"]
    lines += [".SH EXIT STATUS", roff(EXIT_STATUS)]
    lines += [".SH SEE ALSO", *(f".BR {name} ({SECTIONS.get(name, 1)})" for name in others)]
    return "\n".join(lines) + "\n"


# ---- completions

def names_of(flags):
    return " ".join(name for flag in flags for name in flag.names)


def bash(program):
    name = program.name
    verbs = "|".join(command.name for command in program.commands)
    values, words = [], [f"    '') words={json.dumps(' '.join(c.name for c in program.commands) + ' ' + names_of(program.switches))} ;;"]
    for command in [program, *program.commands]:
        verb = "" if command is program else command.name
        if verb:
            words.append(f"    {verb}) words={json.dumps(names_of(command.switches))} ;;")
        for flag in command.switches:
            if flag.takes_value:
                reply = f'COMPREPLY=($(compgen -W "{" ".join(flag.choices)}" -- "$cur")); ' if flag.choices else ""
                values.append("    " + "|".join(f"{verb},{n}" for n in flag.names) + f") {reply}return ;;")
    lines = [f"# bash completion of {name}", f"_{name}() {{",
             "  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD-1]} verb= word words=",
             '  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do',
             f"    case $word in {verbs}) verb=$word; break ;; esac", "  done", "  COMPREPLY=()",
             "  # Without an answer, bash completes names of files.", "  case $verb,$prev in", *values, "  esac",
             "  case $verb in", *words, "  esac",
             '  if [[ $cur == -* || -z $verb ]]; then COMPREPLY=($(compgen -W "$words" -- "$cur")); fi',
             "}", f"complete -o default -F _{name} {name}"]
    return "\n".join(lines) + "\n"


def zsh_quoted(text):
    return re.sub(r"([\[\]:\\])", r"\\\1", first_sentence(text)).replace("'", "'\\''")


def zsh_arguments(flags):
    for flag in flags:
        action = f"({' '.join(flag.choices)})" if flag.choices else "_files" if flag.is_file else " "
        if flag.positional:
            yield f"'{'*' if flag.repeated else ''}:{flag.names[0]}:_files'"
        else:
            for name in flag.names:
                value = f":value:{action}" if flag.takes_value else ""
                yield f"'{'*' if flag.repeated else ''}{name}[{zsh_quoted(flag.text)}]{value}'"


def zsh(program):
    lines = [f"#compdef {program.name}", f"_{program.name}() {{", "  local -a verbs", "  local verb word", "  verbs=("]
    lines += [f"    '{command.name}:{zsh_quoted(command.text)}'" for command in program.commands] + ["  )"]
    lines += ["  for word in ${words[2,CURRENT-1]}; do", f"    case $word in {'|'.join(c.name for c in program.commands)}) verb=$word; break ;; esac",
              "  done", "  case $verb in"]
    for command in program.commands:
        lines += [f"    {command.name}) shift words; (( CURRENT-- )); _arguments \\"]
        lines += [f"      {argument} \\" for argument in zsh_arguments(command.all_flags)] + ["      ;;"]
    lines += ["    *) _arguments \\", *(f"      {argument} \\" for argument in zsh_arguments(program.switches)),
              "      '1:command:{_describe command verbs}' ;;", "  esac", "}", f'_{program.name} "$@"']
    return "\n".join(lines) + "\n"


def fish_quoted(text):
    return "'" + first_sentence(text).replace("\\", "\\\\").replace("'", "\\'") + "'"


def fish(program):
    lines = [f"# fish completion of {program.name}"]
    for command in program.commands:
        lines.append(f"complete -c {program.name} -n __fish_use_subcommand -f -a {command.name} -d {fish_quoted(command.text)}")
    for command in [program, *program.commands]:
        when = "__fish_use_subcommand" if command is program else f"'__fish_seen_subcommand_from {command.name}'"
        for flag in command.switches:
            names = " ".join(f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}" for name in flag.names)
            value = f" -x -a '{' '.join(flag.choices)}'" if flag.choices else " -r" if flag.takes_value else ""
            lines.append(f"complete -c {program.name} -n {when} {names}{value} -d {fish_quoted(flag.text)}")
    return "\n".join(lines) + "\n"


def write(path, text, packed=False):
    path.parent.mkdir(parents=True, exist_ok=True)
    if packed:  # the same bytes on every run: no name and no time
        with open(path, "wb") as file, gzip.GzipFile("", "wb", 9, file, mtime=0) as packer:
            packer.write(text.encode())
    else:
        path.write_text(text, encoding="utf-8")


def main(out, paths):
    run = lambda *words: subprocess.run(words, capture_output=True, text=True, check=True).stdout
    programs = [Command(json.loads(run(path, "--describe"))) for path in paths]
    version = run(paths[0], "--version").split()[-1]
    write(out / "COMMAND_LINE.md", page(programs))
    for program in programs:
        others = [other.name for other in programs if other is not program]
        write(out / f"man/{program.name}.{SECTIONS.get(program.name, 1)}.gz", manual(program, version, others), packed=True)
        write(out / f"completions/bash/{program.name}", bash(program))
        write(out / f"completions/zsh/_{program.name}", zsh(program))
        write(out / f"completions/fish/{program.name}.fish", fish(program))


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]), sys.argv[2:])
