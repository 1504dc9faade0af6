"""One gRPC call for a program without HTTP/2: bridge.py HOST:PORT METHOD. Requests come in and responses go out in base64, one a line; the end of
the input ends the requests. The last line is "end CODE DETAIL DETAILS", the latter two in base64."""
import base64
import sys

import grpc

ADDRESS, METHOD = sys.argv[1:3]
OPTIONS = [("grpc.use_local_subchannel_pool", 1), ("grpc.max_receive_message_length", 64 << 20)]


def requests():
    while line := sys.stdin.readline():
        yield base64.b64decode(line)


def say(*words):
    print(*words, flush=True)


def text(data):
    return base64.b64encode(data).decode()


def main():
    channel = grpc.insecure_channel(ADDRESS, OPTIONS)
    path = f"/sightline.v1.CameraControlService/{METHOD}"
    try:
        if METHOD == "Control":
            for response in channel.stream_stream(path)(requests()):
                say("message", text(response))
        else:
            say("message", text(channel.stream_unary(path)(requests())))
        say("end", 0, "", "")
    except grpc.RpcError as error:
        details = dict(error.trailing_metadata() or ()).get("grpc-status-details-bin", b"")
        say("end", error.code().value[0], text((error.details() or "").encode()), text(details))


main()
