#include "server/service/log.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "server/service/log_sink.h"

namespace sightline {
namespace {

spdlog::level::level_enum to_spdlog(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return spdlog::level::debug;
    case LogLevel::kInfo:
      return spdlog::level::info;
    case LogLevel::kWarning:
      return spdlog::level::warn;
    case LogLevel::kError:
      return spdlog::level::err;
    case LogLevel::kOff:
      break;
  }
  return spdlog::level::off;
}

// Everything outside printable ASCII is escaped: a terminal obeys some control characters beyond ASCII, others turn the
// direction of what follows, and some readers of lines take more than \n for the end of one.
std::string json_string(std::string_view text) {
  return nlohmann::json(text).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

// Bare where that is unambiguous, otherwise quoted as in JSON.
std::string text_value(std::string_view text) {
  const bool bare = !text.empty() && text.find_first_of(" \"=\\") == std::string_view::npos &&
                    std::all_of(text.begin(), text.end(), [](unsigned char c) { return c > 0x20 && c < 0x7F; });
  return bare ? std::string(text) : json_string(text);
}

std::string as_text(std::string_view message, Log::Fields fields) {
  std::string line(message);
  for (const auto& [name, value] : fields) line.append(" ").append(name).append("=").append(text_value(value));
  return line;
}

// The members after time and level, which the pattern writes.
std::string as_json_members(std::string_view message, Log::Fields fields) {
  std::string line = "\"message\":" + json_string(message);
  for (const auto& [name, value] : fields) line.append(",\"").append(name).append("\":").append(json_string(value));
  return line;
}

std::string payload(LogFormat format, std::string_view message, Log::Fields fields) {
  return format == LogFormat::kText ? as_text(message, fields) : as_json_members(message, fields);
}

}  // namespace

Log::Log(LogFormat format, LogLevel level)
    : Log(format, level, std::make_shared<PatientSink>(STDERR_FILENO, [format](uint64_t lines) {
            return payload(format, "log lines dropped", {{"lines", std::to_string(lines)}});
          })) {}

Log::Log(LogFormat format, LogLevel level, std::shared_ptr<spdlog::sinks::sink> sink)
    : format_(format), logger_(std::make_shared<spdlog::logger>("sightlined", std::move(sink))) {
  const char* const pattern = format == LogFormat::kText ? "%Y-%m-%dT%H:%M:%S.%eZ %l %v"
                                                         : R"({"time":"%Y-%m-%dT%H:%M:%S.%eZ","level":"%l",%v})";
  logger_->set_pattern(pattern, spdlog::pattern_time_type::utc);
  logger_->set_level(to_spdlog(level));
  logger_->flush_on(spdlog::level::info);
}

void Log::set_level(LogLevel level) const {
  logger_->set_level(to_spdlog(level));
}

void Log::write(LogLevel level, std::string_view message, Fields fields) const {
  const spdlog::level::level_enum severity = to_spdlog(level);
  if (!logger_->should_log(severity)) return;
  logger_->log(severity, payload(format_, message, fields));
}

}  // namespace sightline
