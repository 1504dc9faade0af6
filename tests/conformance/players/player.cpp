// Plays conformance sessions with the C++ client. tests/conformance/README.md describes the protocol.
#include <google/protobuf/util/json_util.h>

#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/cpp/camera.h"

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
  for (char& letter : name) letter = letter == ' ' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(letter)));
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
  auto opened = Camera::open({command.at("address")}, from_json<v1::OpenSession>(command.at("open")), std::move(options));
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

}  // namespace
}  // namespace sightline

int main() {
  std::optional<sightline::Camera> camera;
  for (std::string line; std::getline(std::cin, line);) {
    const auto command = nlohmann::json::parse(line);
    const auto answer = command.contains("open")   ? sightline::open(camera, command)
                        : command.contains("tick") ? sightline::tick(*camera, command)
                                                   : sightline::close(*camera);
    std::cout << answer << std::endl;
  }
}
