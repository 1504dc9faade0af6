"""Probes such as an orchestrator's, and clients of the metrics port that are not honest."""
import contextlib
import random
import socket
import struct
import threading
import time

from daemon import DATA, END_HEADERS, END_STREAM, HEADERS, HEALTH, SETTINGS, frame, message, request_headers

# As the manifests in deploy/kubernetes have it.
PATIENCE_S = 2


def operators_of(daemon):
    """The address of a daemon's metrics port."""
    daemon.wait_for_log("metrics=")  # the log has a thread of its own
    return daemon.log().split("metrics=")[1].split()[0]


def free_address():
    """One at which nobody listens yet."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"127.0.0.1:{server.getsockname()[1]}"


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


def probe(address, path="/livez", patience_s=PATIENCE_S):
    """(status, text), or (0, reason) when no answer comes in a probe's time."""
    end, answer = time.monotonic() + patience_s, b""
    try:
        with connect(address) as connection:
            connection.settimeout(patience_s)
            connection.sendall(f"GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n".encode())
            while piece := connection.recv(65536):
                answer += piece
                if time.monotonic() > end:
                    return 0, "too slow"
        head, _, text = answer.decode().partition("\r\n\r\n")
        return int(head.split()[1]), text
    except (OSError, ValueError, IndexError) as trouble:
        return 0, repr(trouble)


def asks_health(connection, service="liveness"):
    """Asks the gRPC health service on a new connection, as Kubernetes does. Returns the status of its answer: 1 is SERVING."""
    connection.sendall(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + frame(SETTINGS, 0, 0) + frame(HEADERS, END_HEADERS, 1, request_headers(HEALTH + "Check")) +
                       frame(DATA, END_STREAM, 1, message(b"\x0a" + bytes([len(service)]) + service.encode())))
    data = b""
    while piece := connection.recv(65536):
        data += piece
        while len(data) >= 9 and len(data) >= (end := 9 + int.from_bytes(data[:3], "big")):
            if data[3] == DATA and end > 9 + 5:
                return data[9 + 5 + 1]  # after the head of the message and the number of the field
            data = data[end:]
    raise OSError("the connection was closed without an answer")


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
