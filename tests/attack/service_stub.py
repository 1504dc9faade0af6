"""The stub of a gRPC service, made from the descriptor of its messages, so that no generated service code is needed."""
from google.protobuf import descriptor_pb2, message_factory
from sightline.v1 import camera_control_pb2

_SERVICE = camera_control_pb2.DESCRIPTOR.services_by_name["CameraControlService"]


def _class_of(descriptor):
    if hasattr(message_factory, "GetMessageClass"):
        return message_factory.GetMessageClass(descriptor)
    return message_factory.MessageFactory(descriptor.file.pool).GetPrototype(descriptor)  # protobuf before 4.22


class CameraControlServiceStub:
    """Has the methods of the service as attributes: stub.GetServerInfo(request, timeout=5)."""

    def __init__(self, channel):
        kinds = {(False, False): channel.unary_unary, (False, True): channel.unary_stream,
                 (True, False): channel.stream_unary, (True, True): channel.stream_stream}
        proto = descriptor_pb2.ServiceDescriptorProto()
        _SERVICE.CopyToProto(proto)
        for method, streams in zip(_SERVICE.methods, proto.method):
            make = kinds[streams.client_streaming, streams.server_streaming]
            setattr(self, method.name, make(f"/{_SERVICE.full_name}/{method.name}",
                                            request_serializer=_class_of(method.input_type).SerializeToString,
                                            response_deserializer=_class_of(method.output_type).FromString))
