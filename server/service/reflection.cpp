#include "server/service/reflection.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "server/rpc/call.h"

namespace sightline {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::DescriptorPool;
using google::protobuf::FieldDescriptor;
using google::protobuf::FileDescriptor;

// The messages of both versions have the same names and fields, so these functions fit both.
template <typename FileDescriptorResponse>
void add_with_imports(const FileDescriptor& file, std::set<const FileDescriptor*>& done, FileDescriptorResponse& out) {
  if (!done.insert(&file).second) return;
  google::protobuf::FileDescriptorProto proto;
  file.CopyTo(&proto);
  out.add_file_descriptor_proto(proto.SerializeAsString());
  for (int i = 0; i < file.dependency_count(); ++i) add_with_imports(*file.dependency(i), done, out);
}

template <typename Response>
void answer_with(const FileDescriptor* file, Response& response) {
  if (!file) {
    response.mutable_error_response()->set_error_code(grpc::StatusCode::NOT_FOUND);
    return response.mutable_error_response()->set_error_message("there is no such file or symbol");
  }
  std::set<const FileDescriptor*> done;
  add_with_imports(*file, done, *response.mutable_file_descriptor_response());
}

const FileDescriptor* file_of_extension(const std::string& type, int number) {
  const DescriptorPool& pool = *DescriptorPool::generated_pool();
  const Descriptor* const extended = pool.FindMessageTypeByName(type);
  const FieldDescriptor* const found = extended ? pool.FindExtensionByNumber(extended, number) : nullptr;
  return found ? found->file() : nullptr;
}

template <typename Response>
void answer_with_extensions(const std::string& type, Response& response) {
  const DescriptorPool& pool = *DescriptorPool::generated_pool();
  const Descriptor* const extended = pool.FindMessageTypeByName(type);
  if (!extended) return answer_with(nullptr, response);
  std::vector<const FieldDescriptor*> found;
  pool.FindAllExtensions(extended, &found);
  response.mutable_all_extension_numbers_response()->set_base_type_name(type);
  for (const FieldDescriptor* field : found)
    response.mutable_all_extension_numbers_response()->add_extension_number(field->number());
}

// The answer to one request.
template <typename Request, typename Response>
void reflect(const Request& request, const std::vector<std::string>& services, Response& response) {
  const DescriptorPool& pool = *DescriptorPool::generated_pool();
  response.Clear();
  response.set_valid_host(request.host());
  *response.mutable_original_request() = request;
  switch (request.message_request_case()) {
    case Request::kFileByFilename:
      answer_with(pool.FindFileByName(request.file_by_filename()), response);
      break;
    case Request::kFileContainingSymbol:
      answer_with(pool.FindFileContainingSymbol(request.file_containing_symbol()), response);
      break;
    case Request::kFileContainingExtension:
      answer_with(file_of_extension(request.file_containing_extension().containing_type(),
                                    request.file_containing_extension().extension_number()),
                  response);
      break;
    case Request::kAllExtensionNumbersOfType:
      answer_with_extensions(request.all_extension_numbers_of_type(), response);
      break;
    case Request::kListServices:
      for (const std::string& name : services) response.mutable_list_services_response()->add_service()->set_name(name);
      break;
    case Request::MESSAGE_REQUEST_NOT_SET:
      response.mutable_error_response()->set_error_code(grpc::StatusCode::INVALID_ARGUMENT);
      response.mutable_error_response()->set_error_message("the request asks for nothing");
      break;
  }
}

template <typename Request, typename Response>
using ReflectionCall = AsyncCall<grpc::ServerAsyncReaderWriter<Response, Request>>;

}  // namespace

struct ReflectionService::V1 {
  using Service = grpc::reflection::v1::ServerReflection;
  using Request = grpc::reflection::v1::ServerReflectionRequest;
  using Response = grpc::reflection::v1::ServerReflectionResponse;
};

struct ReflectionService::V1Alpha {
  using Service = grpc::reflection::v1alpha::ServerReflection;
  using Request = grpc::reflection::v1alpha::ServerReflectionRequest;
  using Response = grpc::reflection::v1alpha::ServerReflectionResponse;
};

// One call. All its reactions run on the loop's thread, so it needs no lock.
template <typename Version>
class ReflectionService::Call final : public ReflectionCall<typename Version::Request, typename Version::Response> {
  using Base = ReflectionCall<typename Version::Request, typename Version::Response>;
  using Base::cancel_alarm, Base::finish_call, Base::start_alarm, Base::start_read, Base::start_write;

 public:
  using typename Base::Incoming;

  Call(EventLoop& loop, Timers& timers, std::unique_ptr<Incoming> incoming, ReflectionService& service)
      : Base(loop, std::move(incoming)), service_(service) {
    const grpc::Status admitted = service_.admit_(this->incoming().context);
    if (++service_.open_ > service_.most_calls_) {
      service_.refused_();
      finish({grpc::StatusCode::RESOURCE_EXHAUSTED,
              "all " + std::to_string(service_.most_calls_) + " reflection calls are in use (--max-reflection-calls)"});
    } else if (!admitted.ok()) {
      finish(admitted);
    } else {
      start_read(request_);
      start_alarm(timers, kMostTime);
    }
  }

 private:
  ~Call() override { --service_.open_; }

  void on_read(bool ok) override {
    if (finished_) return;
    if (!ok) return finish(grpc::Status::OK);
    reflect(request_, service_.services_, response_);
    writing_ = true;
    start_write(response_);
  }
  void on_write(bool ok) override {
    writing_ = false;
    if (end_) return finish(*end_);
    if (!ok) return finish(grpc::Status::CANCELLED);
    start_read(request_);
  }
  void on_cancel() override { finish(grpc::Status::CANCELLED); }
  void on_alarm(bool ran_out) override {
    if (!ran_out) return;
    finish({grpc::StatusCode::DEADLINE_EXCEEDED, "a reflection call may take ten seconds"});
    if (writing_) this->cancel_call();  // the client does not read
  }
  void on_done() override { delete this; }

  // Nothing may be started after the end, and no write may be under way at it.
  void finish(const grpc::Status& status) {
    if (finished_) return;
    end_ = status;
    if (writing_) return;
    finished_ = true;
    cancel_alarm();
    finish_call(status);
  }

  ReflectionService& service_;
  typename Version::Request request_;
  typename Version::Response response_;
  bool writing_ = false, finished_ = false;
  std::optional<grpc::Status> end_;
};

void ReflectionService::register_at(grpc::ServerBuilder& builder) {
  builder.RegisterService(&v1_);
  builder.RegisterService(&v1alpha_);
}

void ReflectionService::take_calls(EventLoop& loop, Timers& timers, std::vector<std::string> services) {
  services_ = std::move(services);
  services_.insert(services_.end(), {V1::Service::service_full_name(), V1Alpha::Service::service_full_name()});
  take_calls_of<V1>(v1_, loop, timers);
  take_calls_of<V1Alpha>(v1alpha_, loop, timers);
}

template <typename Version>
void ReflectionService::take_calls_of(typename Version::Service::AsyncService& service, EventLoop& loop,
                                      Timers& timers) {
  using Incoming = typename Call<Version>::Incoming;
  const auto ask = [&](Incoming& incoming, void* tag) {
    service.RequestServerReflectionInfo(&incoming.context, &incoming.responder, &loop.queue(), &loop.server_queue(),
                                        tag);
  };
  CallAcceptor<Incoming>::start(loop, ask, [this, &service, &loop, &timers](std::unique_ptr<Incoming> incoming) {
    take_calls_of<Version>(service, loop, timers);
    new Call<Version>(loop, timers, std::move(incoming), *this);
  });
}

}  // namespace sightline
