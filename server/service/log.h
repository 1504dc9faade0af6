// The log of the daemon, for its operators. Each event is one line, as text or as one JSON object.
//
//   log.info("session opened", {{"session", "1f3-7"}, {"label", "arena"}});
//   text: 2026-03-01T12:00:00.123Z info session opened session=1f3-7 label=arena
//   json: {"time":"2026-03-01T12:00:00.123Z","level":"info","message":"session opened",
//          "session":"1f3-7","label":"arena"}
#pragma once

#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace spdlog {
class logger;
namespace sinks {
class sink;
}
}  // namespace spdlog

namespace sightline {

enum class LogFormat { kText, kJson };
enum class LogLevel { kDebug, kInfo, kWarning, kError, kOff };

// Thread-safe. Values may hold any bytes. Invalid UTF-8 is replaced, and everything outside printable ASCII is escaped
// in both formats, so an event is always one line, and no value can move a cursor or turn the direction of what
// follows.
class Log {
 public:
  using Field = std::pair<std::string_view, std::string>;
  using Fields = std::initializer_list<Field>;

  // Writes to the standard error output, from a thread of its own (log_sink.h), so that no caller waits for a reader.
  Log(LogFormat format, LogLevel level);
  // Writes to `sink`; for tests.
  Log(LogFormat format, LogLevel level, std::shared_ptr<spdlog::sinks::sink> sink);

  void debug(std::string_view message, Fields fields = {}) const { write(LogLevel::kDebug, message, fields); }
  void info(std::string_view message, Fields fields = {}) const { write(LogLevel::kInfo, message, fields); }
  void warn(std::string_view message, Fields fields = {}) const { write(LogLevel::kWarning, message, fields); }
  void error(std::string_view message, Fields fields = {}) const { write(LogLevel::kError, message, fields); }

  // Thread-safe, like everything else.
  void set_level(LogLevel level) const;

 private:
  void write(LogLevel level, std::string_view message, Fields fields) const;

  const LogFormat format_;
  const std::shared_ptr<spdlog::logger> logger_;
};

}  // namespace sightline
