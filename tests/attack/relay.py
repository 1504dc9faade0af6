"""A client at another loopback address, although its library cannot choose one."""
import socket
import threading


class Relay:
    """Takes connections at `address`, and makes each anew to the daemon from `source`, such as 127.0.0.2. The daemon counts clients by address.
    Use it in a `with` statement."""

    def __init__(self, daemon_address, source):
        self.source = source
        host, port = daemon_address.rsplit(":", 1)
        self.to = host, int(port)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % self.listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        try:
            while True:
                near, _ = self.listener.accept()
                far = socket.create_connection(self.to, source_address=(self.source, 0))
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=self._move, args=(one, other), daemon=True).start()
        except OSError:
            pass

    @staticmethod
    def _move(one, other):
        try:
            while data := one.recv(65536):
                other.sendall(data)
        except OSError:
            pass
        for end in (one, other):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.listener.close()
