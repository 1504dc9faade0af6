"""Mixes of HTTP/2 frames of any type, size and stream, drawn at random. A mix is named by its number alone: the same number gives the same bytes."""
import random
import struct

from daemon import (CONTINUATION, CONTROL, DATA, END_HEADERS, END_STREAM, GOAWAY, HEADERS, HEALTH, PING, PRIORITY, RST_STREAM, SERVICE, SETTINGS,
                    WINDOW_UPDATE, frame, message, request_headers)

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + frame(SETTINGS, 0, 0)
PATHS = [CONTROL, SERVICE + "GetServerInfo", SERVICE + "UploadScene", HEALTH + "Watch", HEALTH + "Check", "/no.such.Service/Call"]
# Bytes of frames that are made for one connection. An attacker sends them again and again.
BYTES_OF_ROUND = 1 << 18
LENGTH = {PRIORITY: 5, RST_STREAM: 4, PING: 8, WINDOW_UPDATE: 4, GOAWAY: 8}


class Mix:
    """What one attacker sends: some kinds of frames, each with a weight, and how many connections it uses."""

    def __init__(self, number):
        self.number = number
        self.draw = random.Random(number)
        self.connections = self.draw.choice((1, 1, 2, 4, 8))
        self.addresses = self.draw.choice((1, self.connections))
        kinds = [self.one_kind, self.new_calls, self.messages, self.pieces_of_a_message, self.header_blocks, self.any_frame]
        self.kinds = [kind() for kind in self.draw.choices(kinds, k=self.draw.randint(1, 3))]
        self.weights = [self.draw.random() for _ in self.kinds]

    def __str__(self):
        return f"{self.connections} connections of {self.addresses} clients with " + ", ".join(name for name, _ in self.kinds)

    def round(self, calls):
        """The next frames of a connection on which calls up to the number `calls` were begun; and the new number."""
        self.newest = calls
        data = bytearray()
        while len(data) < BYTES_OF_ROUND:
            for _, make in self.draw.choices(self.kinds, self.weights, k=64):
                data += make()
        return bytes(data), self.newest

    # --- kinds of frames: each returns a name and a function that makes a frame

    def one_kind(self):
        """Frames of one type and size, legal or not, on one kind of stream."""
        kind, flags, stream = self.draw.randrange(12), self.draw.choice((0, 1, 4, 5, 8, 0x20, 0xff)), self.stream()
        size = self.draw.choice((0, 1, LENGTH.get(kind, 6), LENGTH.get(kind, 6), self.draw.randrange(64), 1024, 16384))
        payload = self.draw.choice((bytes(size), self.draw.randbytes(size)))
        return f"type {kind}, flags {flags:#x}, {size} bytes", lambda: frame(kind, flags, stream(), payload)

    def any_frame(self):
        def make():
            size = int(self.draw.paretovariate(0.7)) % 16384
            return frame(self.draw.randrange(14), self.draw.randrange(256), self.stream()(), self.draw.randbytes(size))
        return "any frames", make

    def new_calls(self):
        path, end = self.draw.choice(PATHS), self.draw.choice(("", "reset", "empty end", "message", "trailers"))

        def make():
            data = self.begin(path)
            if end == "reset":
                data += frame(RST_STREAM, 0, self.newest, struct.pack(">I", 8))
            elif end == "trailers":
                data += frame(HEADERS, END_HEADERS | END_STREAM, self.newest, b"\x00\x01x\x01y")
            elif end:
                data += frame(DATA, END_STREAM, self.newest, message(b"") if end == "message" else b"")
            return data
        return f"calls of {path.rsplit('/', 1)[-1]} {end}", make

    def messages(self):
        size, many, stream = self.draw.choice((0, 1, 5, 20, 200, 4000)), self.draw.choice((1, 1, 4, 200)), self.stream()
        many = min(many, 16384 // (size + 5))
        return f"{many} messages of {size} bytes a frame", lambda: frame(DATA, 0, stream(), many * message(self.draw.randbytes(size)))

    def pieces_of_a_message(self):
        """Of a message that never ends, after the call in which it comes."""
        size, calls = self.draw.choice((1, 1, 2, 30, 1000)), self.draw.choice((1, 16, 256))
        begun = []

        def make():
            if len(begun) < calls:
                begun.append(None)
                return self.begin(CONTROL) + frame(DATA, 0, self.newest, struct.pack(">BI", 0, 4_000_000))
            return frame(DATA, 0, max(1, self.newest - 2 * self.draw.randrange(calls)), bytes(size))
        return f"pieces of {size} bytes in {calls} calls", make

    def header_blocks(self):
        size, parts = self.draw.choice((1, 200, 4000, 16000)), self.draw.choice((1, 1, 3, 20))
        # Bytes of 0xbe are fields of HPACK's dynamic table.
        block = request_headers(CONTROL, [("a" * 100, "b" * 100)]) + self.draw.choice((b"\xbe", b"\x82", b"\x00\x01x\x01y")) * size

        def make():
            self.newest += 2
            cut = [block[at:at + 1 + len(block) // parts] for at in range(0, len(block), 1 + len(block) // parts)]
            return b"".join(frame(CONTINUATION if at else HEADERS, END_HEADERS if at == len(cut) - 1 else 0, self.newest, part[:16384])
                            for at, part in enumerate(cut))
        return f"header blocks of {len(block)} bytes in {parts} frames", make

    # --- streams

    def begin(self, path):
        self.newest += 2
        return frame(HEADERS, END_HEADERS, self.newest, request_headers(path))

    def stream(self):
        which = self.draw.randrange(5)
        return [lambda: 0, lambda: max(1, self.newest), lambda: max(1, self.newest - 2 * self.draw.randrange(64)), lambda: self.draw.randrange(1 << 31),
                lambda: self.draw.randrange(1, max(2, self.newest + 1))][which]
