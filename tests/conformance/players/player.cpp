// Plays conformance sessions with the C++ client. tests/conformance/README.md describes the protocol.
#include <google/protobuf/util/json_util.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/cpp/camera.h"
#include "client/cpp/live_camera.h"

namespace sightline {
namespace {

using Json = nlohmann::json;

Json to_json(const google::protobuf::Message& message) {
  std::string text;
  if (!google::protobuf::util::MessageToJsonString(message, &text).ok()) throw std::runtime_error("no JSON");
  return Json::parse(text);
}

template <typename Message>
Message from_json(const Json& json) {
  Message message;
  if (!google::protobuf::util::JsonStringToMessage(json.dump(), &message).ok()) throw std::runtime_error(json.dump());
  return message;
}

// "invalid argument" is INVALID_ARGUMENT.
std::string code_name(ErrorCode code) {
  std::string name(to_string(code));
  for (char& letter : name)
    letter = letter == ' ' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(letter)));
  return name;
}

Json failed(const Error& error) {
  Json violations = Json::array();
  if (!error.field.empty()) violations.push_back({{"field", error.field}, {"description", error.message}});
  return {{"failed", {{"code", code_name(error.code)}, {"violations", violations}}}};
}

std::vector<std::byte> read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  const auto* data = reinterpret_cast<const std::byte*>(bytes.data());
  return {data, data + bytes.size()};
}

std::string text_of(const Json& files, const char* name) {
  if (!files.contains(name)) return {};
  std::ifstream file(files.at(name).get<std::string>());
  return {std::istreambuf_iterator<char>(file), {}};
}

ClientCredentials credentials_of(const Json& trust) {
  const auto token = trust.find("token");
  return {.tls = trust.contains("roots"),
          .roots = text_of(trust, "roots"),
          .certificate = text_of(trust, "certificate"),
          .key = text_of(trust, "key"),
          .token = token == trust.end() ? std::string() : token->get<std::string>()};
}

Json open(std::optional<Camera>& camera, const Json& command) {
  CameraOptions options;
  if (command.contains("trust")) options.credentials = credentials_of(command.at("trust"));
  for (const std::string path : command.at("uploads")) options.uploads.push_back(read_file(path));
  options.scene_file = command.value("scene_file", "");
  if (command.contains("scene")) options.scene = read_file(command.at("scene"));
  auto opened = Camera::open({command.at("address")}, from_json<v1::OpenSession>(command.at("open")),
                             std::move(options));
  if (!opened) return failed(opened.error());
  camera = std::move(*opened);
  return {{"opened", to_json(camera->opened())}};
}

Json tick(Camera& camera, const Json& command) {
  const auto answer = camera.tick(from_json<v1::Tick>(command.at("tick")));
  if (!answer) return failed(answer.error());
  if (const auto* refused = std::get_if<v1::TickError>(&*answer)) return {{"refused", to_json(*refused)}};
  return {{"camera", to_json(std::get<v1::CameraReply>(*answer))}};
}

Json close(Camera& camera) {
  if (const Status closed = camera.close(); !closed) return failed(closed.error());
  return {{"closed", {{"resyncs", camera.resyncs()}, {"resumes", camera.resumes()}}}};
}

// The commands of tests/live for a PoseSampler and a LiveCamera.
struct Live {
  PoseSampler sampler;
  std::optional<LiveCamera> camera;
};

Json sample(Live& live, const Json& at) {
  std::optional<std::array<double, 3>> target;
  if (at.at("target").size() == 3) target = at.at("target").get<std::array<double, 3>>();
  const auto shown = live.sampler.sample(at.at("time_s"), target);
  if (!shown) return {{"sample", nullptr}};
  const auto& [position, rotation, field_of_view, cut] = *shown;
  Json values = position;
  for (const double value : rotation) values.push_back(value);
  values.push_back(field_of_view), values.push_back(cut ? 1 : 0);
  return {{"sample", values}};
}

Json open_live(Live& live, const Json& command) {
  LiveOptions options;
  options.wait = std::chrono::milliseconds(std::lround(1e3 * command.at("wait_s").get<double>()));
  options.camera.scene_file = command.value("scene_file", "");
  live.camera.reset();
  live.camera.emplace(
      LiveCamera::open({command.at("address")}, from_json<v1::OpenSession>(command.at("live_open")), options));
  return {{"live", Json::object()}};
}

double seconds_since(std::chrono::steady_clock::time_point began) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
}

Json tick_live(Live& live, const Json& command) {
  static constexpr const char* kSources[] = {"reply", "predicted", "fallback", "blend"};
  auto tick = from_json<v1::Tick>(command.at("live_tick"));
  const auto began = std::chrono::steady_clock::now();
  const auto view = live.camera->tick(std::move(tick));
  const double took_s = seconds_since(began);
  if (!view) return {{"error", view.error().field == "tick" ? "QUEUE_FULL" : code_name(view.error().code)}};
  const v1::CameraReply reply = view->reply.value_or(v1::CameraReply());
  Json refusals = Json::array(), refusal_codes = Json::array();
  for (const v1::TickError& refusal : view->refusals) {
    refusals.push_back(refusal.sequence());
    refusal_codes.push_back(static_cast<int>(refusal.code()));
  }
  return {{"view",
           {{"position", view->shown.position},
            {"rotation", view->shown.rotation},
            {"field_of_view", view->shown.field_of_view},
            {"cut", view->shown.cut},
            {"age_s", view->age_s},
            {"source", kSources[static_cast<int>(view->source)]},
            {"sequence", view->sequence},
            {"reply", reply.sequence()},
            {"hash", std::to_string(reply.mirror_hash())},
            {"refusals", refusals},
            {"refusal_codes", refusal_codes},
            {"trouble", view->trouble.has_value()},
            {"took_s", took_s}}}};
}

Json close_live(Live& live) {
  const auto began = std::chrono::steady_clock::now();
  live.camera->close();
  return {
      {"live_closed",
       {{"took_s", seconds_since(began)}, {"resyncs", live.camera->resyncs()}, {"resumes", live.camera->resumes()}}}};
}

// Null: it is no command of this kind.
Json run_live(Live& live, const Json& command) {
  if (command.contains("sampler_new")) return live.sampler = {}, Json{{"sampler", Json::object()}};
  if (command.contains("sampler_add"))
    return {{"taken", live.sampler.add(from_json<v1::CameraReply>(command.at("sampler_add")))}};
  if (command.contains("sampler_shift"))
    return live.sampler.shift(command.at("sampler_shift").get<std::array<double, 3>>()),
           Json{{"sampler", Json::object()}};
  if (command.contains("sampler_at")) return sample(live, command.at("sampler_at"));
  if (command.contains("live_open")) return open_live(live, command);
  if (command.contains("live_tick")) return tick_live(live, command);
  if (command.contains("live_close")) return close_live(live);
  return nullptr;
}

}  // namespace
}  // namespace sightline

int main() {
  std::optional<sightline::Camera> camera;
  sightline::Live live;
  for (std::string line; std::getline(std::cin, line);) {
    const auto command = nlohmann::json::parse(line);
    if (const auto answer = sightline::run_live(live, command); !answer.is_null()) {
      std::cout << answer << std::endl;
      continue;
    }
    const auto answer = command.contains("open")   ? sightline::open(camera, command)
                        : command.contains("tick") ? sightline::tick(*camera, command)
                                                   : sightline::close(*camera);
    std::cout << answer << std::endl;
  }
}
