// The stream under a ClientSession: gRPC's callback API on one side, a queue of events on the other.
#pragma once

#include <grpcpp/grpcpp.h>

#include <condition_variable>
#include <deque>

#include "client/queued_stream.h"
#include "client/sightline_client.h"
#include "sightline/v1/camera_control.grpc.pb.h"

namespace sightline {

// Made and started at once; must not be destroyed before wait_end() or cancel_and_wait() returned.
class ClientSession::Stream final : public QueuedStream<v1::ControlRequest, v1::ControlReply> {
 public:
  Stream(std::shared_ptr<grpc::Channel> channel, const v1::OpenSession& request, Handler handler);
  ~Stream() override;

  // The server's first answer.
  Result<v1::SessionOpened> wait_opened(std::chrono::nanoseconds timeout);
  Status send(const v1::Tick& tick);
  void change(const v1::Settings& settings);
  void change(const v1::CameraLimits& limits);
  Result<std::optional<SessionEvent>> receive(std::chrono::nanoseconds timeout);
  Status close(std::chrono::nanoseconds timeout);
  size_t dropped_events() const;

 private:
  void OnReadDone(bool ok) override;
  void OnDone(const grpc::Status& status) override;

  std::optional<SessionEvent> take_reply();  // needs mutex_
  void deliver(SessionEvent event);
  void cancel_and_wait();
  Error end_error() const;  // needs mutex_, ended_

  // constant after construction
  const std::shared_ptr<grpc::Channel> channel_;
  const std::unique_ptr<v1::CameraControl::Stub> stub_;
  const Handler handler_;

  grpc::ClientContext context_;
  v1::ControlReply reply_;  // owned by gRPC between StartRead and OnReadDone

  std::condition_variable changed_;
  // guarded by mutex_
  v1::Tick changes_;    // settings and limits that wait for the next tick
  bool ended_ = false;  // OnDone has run
  grpc::Status end_status_;
  std::optional<v1::SessionOpened> opened_;
  std::deque<SessionEvent> unread_;
  size_t dropped_ = 0;
};

}  // namespace sightline
