// The stream of a ClientSession: connects gRPC's callback API with a queue of ticks to send and a queue of events to
// read.
#pragma once

#include <grpcpp/grpcpp.h>

#include <condition_variable>
#include <deque>
#include <mutex>

#include "client/cpp/sightline_client.h"
#include "sightline/v1/camera_control.grpc.pb.h"

namespace sightline {

// Adds the token of a client to a call; an empty one is none.
void show_token(grpc::ClientContext& context, const std::string& token);
// What a channel to the address needs, or kInvalidArgument (field "token") rather than send a token unencrypted.
Result<std::shared_ptr<grpc::ChannelCredentials>> channel_credentials(const ClientCredentials& credentials,
                                                                      const std::string& address);

// The constructor starts the call; the destructor cancels it and waits for its end.
class ClientSession::Stream final : public grpc::ClientBidiReactor<v1::ControlRequest, v1::ControlResponse> {
 public:
  Stream(std::shared_ptr<grpc::Channel> channel, const std::string& token, v1::ControlRequest first, Handler handler);
  ~Stream() override;

  // The server's first answer.
  Result<v1::SessionOpened> wait_opened(std::chrono::nanoseconds timeout);
  Status send(const v1::Tick& tick);
  void change(const v1::Settings& settings);
  void change(const tuning::v1alpha1::Tuning& tuning);
  void change(const v1::CameraLimits& limits);
  Result<std::optional<SessionEvent>> receive(std::chrono::nanoseconds timeout);
  Status close(std::chrono::nanoseconds timeout);
  size_t dropped_events() const;

 private:
  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnDone(const grpc::Status& status) override;

  void start_next_write();                   // needs mutex_; no write may be under way
  void finish_writing();                     // needs mutex_; once
  std::optional<SessionEvent> take_reply();  // needs mutex_
  void deliver(SessionEvent event);
  void cancel_and_wait();
  Error end_error() const;  // needs mutex_, ended_

  // constant after construction
  const std::shared_ptr<grpc::Channel> channel_;
  const std::unique_ptr<v1::CameraControlService::Stub> stub_;
  const Handler handler_;

  grpc::ClientContext context_;
  v1::ControlResponse reply_;  // owned by gRPC between StartRead and OnReadDone

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  // guarded by mutex_
  std::deque<v1::ControlRequest> unsent_;  // the front is being written while writing_
  v1::Tick changes_;                       // settings and limits that wait for the next tick
  bool writing_ = false;
  bool closing_ = false;      // no more sends
  bool writes_done_ = false;  // the hold is released
  bool ended_ = false;        // OnDone has run
  grpc::Status end_status_;
  std::optional<v1::SessionOpened> opened_;
  std::deque<SessionEvent> unread_;
  size_t dropped_ = 0;
};

}  // namespace sightline
