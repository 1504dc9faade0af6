using System;
using System.Threading;
using System.Threading.Tasks;
using Google.Protobuf;
using Grpc.Core;
using Sightline.V1;

namespace Sightline.Client {

// One call of Control on a channel of its own. Throws FailedException only.
internal sealed class ControlStream : IDisposable {
    const int ChunkBytes = 512 << 10;

    readonly ChannelBase channel;
    readonly CameraControlService.CameraControlServiceClient client;
    readonly CancellationTokenSource cancel = new CancellationTokenSource();
    readonly AsyncDuplexStreamingCall<ControlRequest, ControlResponse> call;

    /// <summary>Why the daemon takes no more ticks; null: it does.</summary>
    public string Drained { get; private set; }

    public ControlStream(ChannelBase channel) {
        this.channel = channel;
        client = new CameraControlService.CameraControlServiceClient(channel);
        call = client.Control(cancellationToken: cancel.Token);
    }

    public Task SendAsync(ControlRequest request, TimeSpan timeout) {
        return InTime(Guard(async () => { await call.RequestStream.WriteAsync(request); return true; }), timeout);
    }

    /// <summary>The next response that is no Drain.</summary>
    public async Task<ControlResponse> ReceiveAsync(TimeSpan timeout) {
        while (true) {
            if (!await InTime(Guard(() => call.ResponseStream.MoveNext(cancel.Token)), timeout))
                throw new FailedException(StatusCode.Unavailable, Drained ?? "the daemon has ended the session");
            var response = call.ResponseStream.Current;
            if (response.MessageCase != ControlResponse.MessageOneofCase.Drain) return response;
            Drained = response.Drain.Reason.Length > 0 ? response.Drain.Reason : "the daemon is going away";
        }
    }

    public Task<UploadSceneResponse> UploadAsync(byte[] scene, TimeSpan timeout) {
        return Guard(async () => {
            using (var upload = client.UploadScene(deadline: DateTime.UtcNow + timeout)) {
                try {
                    for (int at = 0; at < scene.Length; at += ChunkBytes) {
                        int size = Math.Min(ChunkBytes, scene.Length - at);
                        await upload.RequestStream.WriteAsync(new UploadSceneRequest { Chunk = ByteString.CopyFrom(scene, at, size) });
                    }
                    await upload.RequestStream.CompleteAsync();
                } catch (Exception error) when (error is RpcException || error is InvalidOperationException) {
                    // The daemon has ended the call, and the response says why.
                }
                return await upload.ResponseAsync;
            }
        });
    }

    /// <summary>Ends the session in order.</summary>
    public async Task FinishAsync(TimeSpan timeout) {
        await Guard(async () => { await call.RequestStream.CompleteAsync(); return true; });
        while (await InTime(Guard(() => call.ResponseStream.MoveNext(cancel.Token)), timeout)) { }
    }

    public void Dispose() {
        cancel.Cancel();
        call.Dispose();
        (channel as IDisposable)?.Dispose();
    }

    static async Task<T> Guard<T>(Func<Task<T>> work) {
        try {
            return await work();
        } catch (RpcException error) {
            throw FailedException.From(error);
        } catch (Exception error) when (error is OperationCanceledException || error is InvalidOperationException || error is ObjectDisposedException) {
            // The call has ended: writing to it throws InvalidOperationException.
            throw new FailedException(StatusCode.Unavailable, error.Message);
        }
    }

    async Task<T> InTime<T>(Task<T> work, TimeSpan timeout) {
        using (var stop = new CancellationTokenSource()) {
            if (await Task.WhenAny(work, Task.Delay(timeout, stop.Token)) == work) {
                stop.Cancel();
                return await work;
            }
        }
        cancel.Cancel();
        throw new FailedException(StatusCode.Unavailable, "the daemon has answered nothing for " + timeout.TotalSeconds + " s");
    }
}

}  // namespace Sightline.Client
