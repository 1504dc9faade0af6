using System;
using System.Collections.Generic;
using Grpc.Core;
using Sightline.V1;

namespace Sightline.Client {

/// <summary>The session could not be opened, or it was lost and no daemon took it over in time. The next tick of a camera that lost its session tries
/// again.</summary>
public sealed class FailedException : Exception {
    /// <summary>The gRPC status. Unavailable: no daemon answers, or the connection broke.</summary>
    public StatusCode Code { get; }
    /// <summary>The fields of the request that are wrong; empty if the request was not the cause.</summary>
    public IReadOnlyList<FieldViolation> Violations { get; }

    public FailedException(StatusCode code, string message, IReadOnlyList<FieldViolation> violations = null) : base(code + ": " + message) {
        Code = code;
        Violations = violations ?? new FieldViolation[0];
    }

    internal static FailedException From(RpcException error) {
        return new FailedException(error.StatusCode, error.Status.Detail, StatusDetails.Violations(error.Trailers));
    }

    // The refusal of a tick that ends each call in which it is sent. The kinds of errors have the names of gRPC's codes.
    internal TickError AsRefusal(ulong sequence) {
        TickError.Types.Code code;
        if (!Enum.TryParse(Code.ToString(), out code)) code = TickError.Types.Code.InvalidArgument;
        return new TickError { Sequence = sequence, Code = code, Message = Message, FieldViolations = { Violations } };
    }

    // A part of a field that is wrong has this name.
    internal bool Names(string part) {
        foreach (var violation in Violations)
            if (violation.Field.Contains(part)) return true;
        return false;
    }

    // Another attempt, or another daemon, may help. A scene file that is too large stays so.
    internal bool IsLost(bool opening) {
        switch (Code) {
            case StatusCode.Unavailable:
            case StatusCode.Cancelled:
            case StatusCode.Unknown:
            case StatusCode.Internal:
            case StatusCode.DeadlineExceeded:
            case StatusCode.Aborted:
                return true;
            default:
                return opening && Code == StatusCode.ResourceExhausted && !Names("chunk");
        }
    }
}

/// <summary>The daemon refused a tick, and the session goes on. The text names the field and what is wrong. Nothing of the tick was applied, unless the
/// text says that its step failed.</summary>
public sealed class RefusedException : Exception {
    public TickError Error { get; }

    public RefusedException(TickError error) : base(error.Message) { Error = error; }

    // The tick was applied, and only its step failed (see TickError).
    internal bool WasApplied =>
        (Error.Code == TickError.Types.Code.Internal || Error.Code == TickError.Types.Code.Unavailable) && Error.FieldViolations.Count == 0;
}

/// <summary>A tick that was not taken, because too many wait for a daemon.</summary>
public sealed class QueueFullException : Exception {
    public QueueFullException(string message) : base(message) { }
}

}  // namespace Sightline.Client
