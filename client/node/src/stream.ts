// One call of Control on a connection of its own.
import {create, fromBinary, toBinary, type DescMessage, type MessageShape} from "@bufbuild/protobuf";
import {Client, Metadata, credentials, type ChannelCredentials, type ClientDuplexStream, type ServiceError} from "@grpc/grpc-js";

import {
  ControlRequestSchema, ControlResponseSchema, UploadSceneRequestSchema, UploadSceneResponseSchema, type ControlRequest, type ControlResponse,
  type UploadSceneResponse,
} from "./gen/sightline/v1/camera_control_pb.js";
import {Failed, failedCall, unavailable} from "./errors.js";

const SERVICE = "/sightline.v1.CameraControlService/";
const CHUNK_BYTES = 512 << 10;

function serialize<Desc extends DescMessage>(schema: Desc) {
  return (message: MessageShape<Desc>) => Buffer.from(toBinary(schema, message));
}

function parse<Desc extends DescMessage>(schema: Desc) {
  return (bytes: Buffer) => fromBinary(schema, bytes);
}

// How a connection is encrypted. All are PEM files.
export interface Tls {
  roots?: Buffer; // those whose signature makes the daemon's certificate valid. Default: Node's own
  certificate?: Buffer; // what the client shows of itself, for daemons that ask for it
  key?: Buffer;
}

// Identity of the client, and its way to a daemon.
export interface Trust {
  tls?: Tls; // encrypts TCP. Default: it is not encrypted
  token?: string; // identifies the client to the daemon; needs tls or a unix socket
}

function channelCredentials(address: string, {tls, token}: Trust): ChannelCredentials {
  const local = address.startsWith("unix:");
  if (tls && !local) return credentials.createSsl(tls.roots ?? null, tls.key ?? null, tls.certificate ?? null);
  if (token !== undefined && !local) throw new TypeError("token: is sent only over TLS (tls) or a unix socket");
  return credentials.createInsecure();
}

// Throws TypeError for a token that would be sent unencrypted.
export function checkTrust(address: string, trust: Trust): void {
  channelCredentials(address, trust);
}

function metadataOf({token}: Trust): Metadata {
  const metadata = new Metadata();
  if (token !== undefined) metadata.set("authorization", `Bearer ${token}`);
  return metadata;
}

export class Stream {
  drained?: string; // the reason why the daemon takes no more ticks
  private readonly client: Client;
  private readonly call: ClientDuplexStream<ControlRequest, ControlResponse>;
  private readonly unread: ControlResponse[] = [];
  private end?: Failed | null; // null: the daemon has ended the call in order
  private wake?: () => void;

  constructor(address: string, private readonly trust: Trust) {
    // gRPC would otherwise share one connection, and its own pauses between attempts with it. Replies with depth maps exceed gRPC's default
    // limit of 4 MiB.
    this.client = new Client(address, channelCredentials(address, trust),
      {"grpc.use_local_subchannel_pool": 1, "grpc.max_receive_message_length": 64 << 20});
    this.call = this.client.makeBidiStreamRequest(`${SERVICE}Control`, serialize(ControlRequestSchema), parse(ControlResponseSchema),
      metadataOf(trust));
    this.call.on("data", (response: ControlResponse) => this.take(response));
    this.call.on("error", (error: ServiceError) => this.finishReading(failedCall(error)));
    this.call.on("end", () => this.finishReading(null));
  }

  send(message: ControlRequest["message"]): void {
    if (this.end === undefined) this.call.write(create(ControlRequestSchema, {message}));
  }

  // The next response, or null when the daemon has ended the call in order. Throws Failed.
  async next(timeoutS: number): Promise<ControlResponse | null> {
    if (!this.unread.length && this.end === undefined) {
      await new Promise<void>((resolve) => {
        const timer = setTimeout(resolve, timeoutS * 1000);
        this.wake = () => (clearTimeout(timer), resolve());
      });
      this.wake = undefined;
    }
    const response = this.unread.shift();
    if (response) return response;
    if (this.end === undefined) throw unavailable(`the daemon has answered nothing for ${timeoutS} s`);
    if (this.end) throw this.end;
    return null;
  }

  // The next response. Throws Failed.
  async receive(timeoutS: number): Promise<ControlResponse> {
    const response = await this.next(timeoutS);
    if (!response) throw unavailable(this.drained || "the daemon has ended the session");
    return response;
  }

  async upload(scene: Uint8Array, timeoutS: number): Promise<UploadSceneResponse> {
    return await new Promise((resolve, reject) => {
      const call = this.client.makeClientStreamRequest(`${SERVICE}UploadScene`, serialize(UploadSceneRequestSchema), parse(UploadSceneResponseSchema),
        metadataOf(this.trust), {deadline: Date.now() + timeoutS * 1000}, (error, response) => (error ? reject(failedCall(error)) : resolve(response!)));
      for (let at = 0; at < scene.length; at += CHUNK_BYTES)
        call.write(create(UploadSceneRequestSchema, {chunk: scene.subarray(at, at + CHUNK_BYTES)}));
      call.end();
    });
  }

  // Ends the session in order. Throws Failed if it was lost.
  async finish(timeoutS: number): Promise<void> {
    this.call.end();
    try {
      while (await this.next(timeoutS));
    } finally {
      this.cutOff();
    }
  }

  cutOff(): void {
    this.finishReading(null);
    this.call.cancel();
    this.client.close();
  }

  private take(response: ControlResponse): void {
    if (response.message.case === "drain") {
      this.drained = response.message.value.reason;
      this.call.end(); // the daemon need not wait for more ticks; it answers those that it has
    }
    this.unread.push(response);
    this.wake?.();
  }

  private finishReading(end: Failed | null): void {
    if (this.end === undefined) this.end = end;
    this.wake?.();
  }
}
