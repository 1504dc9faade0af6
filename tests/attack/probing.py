"""Probes such as an orchestrator's, and clients that hold the metrics port meanwhile."""
import socket
import subprocess
import time

from daemon import DATA, END_HEADERS, END_STREAM, HEADERS, HEALTH, SETTINGS, Beside, frame, message, request_headers

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


class HeldPort(Beside):
    """`count` clients in a process of their own, each of which keeps a connection to `address` and makes it again when it is cut. `behave` is the name
    of a function in port_clients.py. With `anywhere` each client comes from an address of its own. Use it in a `with` statement; `made` is the number
    of connections afterwards."""

    def __init__(self, address, behave, count, anywhere=False):
        super().__init__("port_clients.py", "held", address, behave, count, int(anywhere), stdin=subprocess.PIPE)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.made = self.result()["made"]
