"""Clients of the metrics port that are not honest: port_clients.py ADDRESS BEHAVIOUR COUNT ANYWHERE.

COUNT clients each keep a connection to ADDRESS, host:port, and make it again when it is cut. BEHAVIOUR is the name of a function below. With ANYWHERE 1
each client comes from an address of its own. Prints "held" once all are connected, or after ten seconds. Goes on until its input ends, and prints a JSON
object with the number of connections that were made.
"""
import contextlib
import json
import random
import socket
import struct
import sys
import threading
import time

from probing import connect


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


def main(address, behaviour, count, anywhere):
    behave, stopping, made = globals()[behaviour], threading.Event(), []
    receive_bytes = 2048 if behave is takes_no_answer else None

    def keep():
        source = any_address() if anywhere == "1" else None
        while not stopping.is_set():
            with contextlib.suppress(OSError), connect(address, source, receive_bytes) as connection:
                made.append(1)
                behave(connection, stopping)
    clients = [threading.Thread(target=keep) for _ in range(int(count))]
    for client in clients:
        client.start()
    end = time.monotonic() + 10
    while len(made) < len(clients) and time.monotonic() < end:
        time.sleep(0.01)
    print("held", flush=True)
    sys.stdin.read()
    stopping.set()
    for client in clients:
        client.join()
    print(json.dumps({"made": len(made)}))


if __name__ == "__main__":
    main(*sys.argv[1:])
