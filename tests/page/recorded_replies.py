"""recorded_replies.py FILE: every reply of a recording as JSON, read by the format's own reader (PyPI: mcap) with the schemas that the
file carries."""
import json
import sys

from google.protobuf.json_format import MessageToDict
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def with_defaults(message):
    try:
        return MessageToDict(message, preserving_proto_field_name=True, always_print_fields_with_no_presence=True)
    except TypeError:  # as older versions call it
        return MessageToDict(message, preserving_proto_field_name=True, including_default_value_fields=True)


with open(sys.argv[1], "rb") as stream:
    reader = make_reader(stream, decoder_factories=[DecoderFactory()])
    replies = [decoded.decoded_message for decoded in reader.iter_decoded_messages(topics=["/sightline/reply"])]
    json.dump([with_defaults(reply) for reply in replies], sys.stdout)
