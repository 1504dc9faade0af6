"""A probe such as an orchestrator's, and clients of the metrics port that are not honest."""
import contextlib
import random
import socket
import struct
import threading
import time

# As the manifests in deploy/kubernetes have it.
PATIENCE_S = 2


def operators_of(daemon):
    """The address of a daemon's metrics port."""
    daemon.wait_for_log("metrics=")  # the log has a thread of its own
    return daemon.log().split("metrics=")[1].split()[0]


def connect(address, source=None, receive_bytes=None):
    host, port = address.rsplit(":", 1)
    connection = socket.socket()
    connection.settimeout(PATIENCE_S)
    if receive_bytes:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
    if source:
        connection.bind((source, 0))
    try:
        connection.connect((host, int(port)))
    except OSError:
        connection.close()
        raise
    return connection


def probe(address, path="/livez"):
    """(status, text), or (0, reason) when no answer comes in a probe's time."""
    end, answer = time.monotonic() + PATIENCE_S, b""
    try:
        with connect(address) as connection:
            connection.sendall(f"GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n".encode())
            while piece := connection.recv(65536):
                answer += piece
                if time.monotonic() > end:
                    return 0, "too slow"
        head, _, text = answer.decode().partition("\r\n\r\n")
        return int(head.split()[1]), text
    except (OSError, ValueError, IndexError) as trouble:
        return 0, repr(trouble)


def any_address():
    return "127." + ".".join(str(random.randrange(1, 255)) for _ in range(3))


# What a client does on one connection until it is cut or `stopping` is set.

def is_silent(connection, stopping):
    wait_for_end(connection, stopping)


def sends_a_header_now_and_then(connection, stopping):
    connection.sendall(b"GET /livez HTTP/1.1\r\n")
    while not stopping.wait(0.2):
        connection.sendall(b"x: y\r\n")


def takes_no_answer(connection, stopping):
    connection.sendall(b"GET /metrics HTTP/1.1\r\n\r\n")
    stopping.wait(30)


def sends_many_requests_at_once(connection, stopping):
    connection.sendall(b"GET /metrics HTTP/1.1\r\n\r\n" * 2000)
    wait_for_end(connection, stopping)


def sends_an_endless_header(connection, stopping):
    connection.sendall(b"GET /livez HTTP/1.1\r\nx: ")
    while not stopping.is_set():
        connection.sendall(b"y" * 65536)


def asks_again_and_again(connection, stopping):
    connection.sendall(b"GET /metrics HTTP/1.1\r\n\r\n")
    wait_for_end(connection, stopping)


def resets(connection, _):
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


def wait_for_end(connection, stopping):
    connection.settimeout(0.5)
    while not stopping.is_set():
        with contextlib.suppress(TimeoutError):
            if not connection.recv(65536):
                return


class HeldPort:
    """`count` clients that each keep a connection to `address` and make it again when it is cut. With `anywhere` each comes from an address of its own.
    Use it in a `with` statement."""

    def __init__(self, address, behave, count, anywhere=False):
        self.stopping, self.made = threading.Event(), 0
        receive_bytes = 2048 if behave is takes_no_answer else None

        def keep():
            source = any_address() if anywhere else None
            while not self.stopping.is_set():
                with contextlib.suppress(OSError), connect(address, source, receive_bytes) as connection:
                    self.made += 1
                    behave(connection, self.stopping)
        self.clients = [threading.Thread(target=keep) for _ in range(count)]

    def __enter__(self):
        for client in self.clients:
            client.start()
        end = time.monotonic() + 10
        while self.made < len(self.clients) and time.monotonic() < end:
            time.sleep(0.01)
        return self

    def __exit__(self, *_):
        self.stopping.set()
        for client in self.clients:
            client.join()
