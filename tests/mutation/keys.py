"""Names and numbers of mutants that stay the same from run to run."""
import hashlib
import zlib

# Each source file has a block of numbers of its own, so that an unchanged file is rewritten into the same text whatever else is rewritten.
BLOCKS = 1024
BLOCK = 2048            # mutants of a file at most
NUMBERS = BLOCKS * BLOCK


def key(mutant):
    """Unique among all mutants, and the same until the file's text changes there: the ordinal counts the mutants of a file with equal change and
    text."""
    return mutant["file"], mutant["change"], mutant["text"], mutant.get("ordinal", 1)


def place(mutant, seed):
    """Where the seed puts the mutant among all, from 0 to 1. Each has its place by itself, so that a change of the sources moves no other."""
    return int.from_bytes(hashlib.sha256(repr((seed, key(mutant))).encode()).digest()[:8]) / 2**64


def first_numbers(files):
    """The first number of each file. `files` are all source files, chosen or not: the few that meet in a block move on to the next free one."""
    taken, first = set(), {}
    for file in sorted(files):
        block = zlib.crc32(file.encode()) % BLOCKS
        while block in taken:
            block = (block + 1) % BLOCKS
        taken.add(block)
        first[file] = block * BLOCK
    return first
