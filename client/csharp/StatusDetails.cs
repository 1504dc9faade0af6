using System.Collections.Generic;
using Google.Protobuf;
using Grpc.Core;
using Sightline.V1;

namespace Sightline.Client {

// Reads the details of a failed call: google.rpc.Status with a google.rpc.BadRequest. Google's own package of these messages would be one more
// dependency for Unity, and this is all that is needed of it.
internal static class StatusDetails {
    const uint StatusDetailsTag = 3 << 3 | 2, AnyTypeTag = 1 << 3 | 2, AnyValueTag = 2 << 3 | 2, ViolationTag = 1 << 3 | 2;

    public static List<FieldViolation> Violations(Metadata trailers) {
        var found = new List<FieldViolation>();
        foreach (var entry in trailers)
            if (entry.Key == "grpc-status-details-bin") ReadStatus(entry.ValueBytes, found);
        return found;
    }

    static void ReadStatus(byte[] status, List<FieldViolation> found) {
        foreach (var any in Fields(status, StatusDetailsTag)) {
            string type = "";
            foreach (var name in Fields(any.ToByteArray(), AnyTypeTag)) type = name.ToStringUtf8();
            if (!type.EndsWith("/google.rpc.BadRequest")) continue;
            foreach (var request in Fields(any.ToByteArray(), AnyValueTag))
                foreach (var violation in Fields(request.ToByteArray(), ViolationTag)) found.Add(FieldViolation.Parser.ParseFrom(violation));
        }
    }

    static List<ByteString> Fields(byte[] message, uint wanted) {
        var found = new List<ByteString>();
        var input = new CodedInputStream(message);
        for (uint tag; (tag = input.ReadTag()) != 0;) {
            if (tag == wanted) found.Add(input.ReadBytes());
            else input.SkipLastField();
        }
        return found;
    }
}

}  // namespace Sightline.Client
