// As much of Grpc.Core.Api and Grpc.Net.Client as the C# client uses, and what grpc_csharp_plugin generates for it. The calls go through the
// program that the environment variable SIGHTLINE_BRIDGE names (bridge.py), because Mono has no HTTP/2.
using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Threading;
using System.Threading.Tasks;
using Google.Protobuf;

namespace System.Net.Http {

public abstract class HttpMessageHandler : IDisposable {
    public void Dispose() { }
}

}  // namespace System.Net.Http

namespace Grpc.Core {

public enum StatusCode {
    OK = 0, Cancelled = 1, Unknown = 2, InvalidArgument = 3, DeadlineExceeded = 4, NotFound = 5, AlreadyExists = 6, PermissionDenied = 7,
    ResourceExhausted = 8, FailedPrecondition = 9, Aborted = 10, OutOfRange = 11, Unimplemented = 12, Internal = 13, Unavailable = 14,
    DataLoss = 15, Unauthenticated = 16
}
public struct Status {
    public Status(StatusCode code, string detail) { StatusCode = code; Detail = detail; }
    public StatusCode StatusCode { get; }
    public string Detail { get; }
}
public sealed class Metadata : List<Metadata.Entry> {
    public sealed class Entry {
        public Entry(string key, byte[] value) { Key = key; ValueBytes = value; }
        public string Key { get; }
        public byte[] ValueBytes { get; }
    }
}
public sealed class RpcException : Exception {
    public RpcException(Status status, Metadata trailers) : base(status.Detail) { Status = status; Trailers = trailers; }
    public Status Status { get; }
    public StatusCode StatusCode => Status.StatusCode;
    public Metadata Trailers { get; }
}
public abstract class ChannelBase {
    protected ChannelBase(string target) { Target = target; }
    public string Target { get; }
}
public interface IAsyncStreamReader<out T> {
    T Current { get; }
    Task<bool> MoveNext(CancellationToken cancellationToken);
}
public interface IClientStreamWriter<in T> {
    Task WriteAsync(T message);
    Task CompleteAsync();
}
public sealed class AsyncDuplexStreamingCall<TRequest, TResponse> : IDisposable {
    readonly Action dispose;
    public AsyncDuplexStreamingCall(IClientStreamWriter<TRequest> requests, IAsyncStreamReader<TResponse> responses, Action dispose) {
        RequestStream = requests; ResponseStream = responses; this.dispose = dispose;
    }
    public IClientStreamWriter<TRequest> RequestStream { get; }
    public IAsyncStreamReader<TResponse> ResponseStream { get; }
    public void Dispose() { dispose(); }
}
public sealed class AsyncClientStreamingCall<TRequest, TResponse> : IDisposable {
    readonly Action dispose;
    public AsyncClientStreamingCall(IClientStreamWriter<TRequest> requests, Task<TResponse> response, Action dispose) {
        RequestStream = requests; ResponseAsync = response; this.dispose = dispose;
    }
    public IClientStreamWriter<TRequest> RequestStream { get; }
    public Task<TResponse> ResponseAsync { get; }
    public void Dispose() { dispose(); }
}

// A call: a child process that takes requests and gives responses, each in base64 on a line.
sealed class BridgedCall<TRequest, TResponse> : IClientStreamWriter<TRequest>, IAsyncStreamReader<TResponse>
    where TRequest : IMessage where TResponse : IMessage<TResponse> {
    readonly Process process;
    readonly MessageParser<TResponse> parser;
    bool isOver;

    public BridgedCall(ChannelBase channel, string method, MessageParser<TResponse> parser, CancellationToken cancel) {
        this.parser = parser;
        var words = Environment.GetEnvironmentVariable("SIGHTLINE_BRIDGE").Split(new[] { ' ' }, 2);
        var start = new ProcessStartInfo(words[0], words[1] + " " + channel.Target + " " + method) {
            UseShellExecute = false, RedirectStandardInput = true, RedirectStandardOutput = true
        };
        process = Process.Start(start);
        cancel.Register(Stop);
    }
    public TResponse Current { get; private set; }

    public Task WriteAsync(TRequest message) {
        if (isOver) throw new InvalidOperationException("the call is over");
        return Task.Run(() => {
            try {
                process.StandardInput.WriteLine(Convert.ToBase64String(message.ToByteArray()));
                process.StandardInput.Flush();
            } catch (System.IO.IOException) {
                throw new RpcException(new Status(StatusCode.Unavailable, "the call has ended"), new Metadata());
            }
        });
    }
    public Task CompleteAsync() {
        process.StandardInput.Close();
        return Task.FromResult(true);
    }
    public Task<bool> MoveNext(CancellationToken cancel) {
        return Task.Run(() => Take(process.StandardOutput.ReadLine()));
    }
    bool Take(string line) {
        if (line != null && line.StartsWith("message ")) {
            Current = parser.ParseFrom(Convert.FromBase64String(line.Substring(8)));
            return true;
        }
        isOver = true;
        if (line == null) throw new RpcException(new Status(StatusCode.Cancelled, "cancelled"), new Metadata());
        var words = line.Split(' ');  // end CODE DETAIL DETAILS
        var code = (StatusCode)int.Parse(words[1]);
        if (code == StatusCode.OK) return false;
        var trailers = new Metadata();
        if (words[3].Length > 0) trailers.Add(new Metadata.Entry("grpc-status-details-bin", Convert.FromBase64String(words[3])));
        throw new RpcException(new Status(code, System.Text.Encoding.UTF8.GetString(Convert.FromBase64String(words[2]))), trailers);
    }
    public async Task<TResponse> Only() {
        await MoveNext(CancellationToken.None);
        return Current;
    }
    public void Stop() {
        isOver = true;
        try { process.Kill(); } catch (Exception) { }  // it may have ended
    }
}

}  // namespace Grpc.Core

namespace Grpc.Net.Client {

public sealed class GrpcChannelOptions {
    public int? MaxReceiveMessageSize { get; set; }
    public System.Net.Http.HttpMessageHandler HttpHandler { get; set; }
    public bool DisposeHttpClient { get; set; }
}
public sealed class GrpcChannel : Grpc.Core.ChannelBase, IDisposable {
    GrpcChannel(string target) : base(target) { }
    public static GrpcChannel ForAddress(string address) { return new GrpcChannel(new Uri(address).Authority); }
    public static GrpcChannel ForAddress(string address, GrpcChannelOptions options) { return ForAddress(address); }
    public void Dispose() { }
}

}  // namespace Grpc.Net.Client

namespace Sightline.V1 {

public static class CameraControlService {
    public sealed class CameraControlServiceClient {
        readonly Grpc.Core.ChannelBase channel;
        public CameraControlServiceClient(Grpc.Core.ChannelBase channel) { this.channel = channel; }
        public Grpc.Core.AsyncDuplexStreamingCall<ControlRequest, ControlResponse> Control(
            Grpc.Core.Metadata headers = null, DateTime? deadline = null, CancellationToken cancellationToken = default(CancellationToken)) {
            var call = new Grpc.Core.BridgedCall<ControlRequest, ControlResponse>(channel, "Control", ControlResponse.Parser, cancellationToken);
            return new Grpc.Core.AsyncDuplexStreamingCall<ControlRequest, ControlResponse>(call, call, call.Stop);
        }
        public Grpc.Core.AsyncClientStreamingCall<UploadSceneRequest, UploadSceneResponse> UploadScene(
            Grpc.Core.Metadata headers = null, DateTime? deadline = null, CancellationToken cancellationToken = default(CancellationToken)) {
            var call = new Grpc.Core.BridgedCall<UploadSceneRequest, UploadSceneResponse>(channel, "UploadScene", UploadSceneResponse.Parser, cancellationToken);
            return new Grpc.Core.AsyncClientStreamingCall<UploadSceneRequest, UploadSceneResponse>(call, call.Only(), call.Stop);
        }
    }
}

}  // namespace Sightline.V1
