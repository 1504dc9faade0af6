// The command line of sightlined.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "server/faulty_device.h"
#include "server/sample/sampler_choice.h"
#include "server/service/log.h"

namespace sightline {

// The values of the flags, with their defaults. `sightlined --help` describes each flag.
struct Flags {
  std::string listen = "127.0.0.1:50151";  // "none": no TCP
  std::string listen_unix;
  unsigned unix_mode = 0660;
  std::string tls_cert, tls_key, tls_client_ca;
  std::string access_file;
  bool allow_insecure_network = false;
  std::string scene_dir;
  SamplerChoice sampler = SamplerChoice::kAuto;
  int egl_device = -1;
  bool require_gpu = false;
  unsigned threads = 0;         // 0: one for each CPU that the process may use
  double step_budget_ms = 0.0;  // 0: no fixed limit
  bool no_degrade = false;
  size_t max_sessions = 256;
  size_t max_sessions_per_client = 0;  // 0: three quarters of max_sessions
  size_t max_connections = 256;
  size_t max_connections_per_client = 0;  // 0: three quarters of max_connections
  double session_idle_s = 300.0;          // 0: never
  double resume_grace_s = 10.0;           // 0: no session is kept
  size_t max_health_watches = 512;
  size_t max_reflection_calls = 16;
  size_t max_uploads = 8;
  size_t kept_uploads_mib = 64;
  // The flags of memory have smaller defaults where a control group limits the memory (base/memory_budget.h).
  size_t max_message_memory_mib = 32;
  size_t session_memory_mib = 64;
  size_t sessions_memory_mib = 256;
  size_t client_memory_mib = 0;  // 0: three quarters of sessions_memory_mib
  size_t geometry_memory_mib = 192;
  size_t client_scenes_memory_mib = 0;  // 0: three quarters of geometry_memory_mib
  size_t messages_memory_mib = 128;
  size_t transport_memory_mib = 128;  // 0: no limit
  double max_step_cost_ms = 33.0;     // 0: no limit
  double max_maps_ms = 100.0;         // 0: no limit
  double max_load_s = 30.0;           // of processor time; 0: no limit
  size_t max_message_mib = 4;
  size_t max_upload_mib = 64;
  double open_timeout_s = 10.0;
  double upload_timeout_s = 60.0;
  LogFormat log_format = LogFormat::kText;
  LogLevel log_level = LogLevel::kInfo;
  std::string ready_file;
  std::string metrics_listen = "none";  // "none": no port for metrics and probes
  double stall_s = 10.0;
  double drain_s = 5.0;
  std::string record_dir;  // empty: nothing is recorded
  bool record_all = true;  // false: only sessions whose client asks for it
  bool record_scenes = false;
  uint64_t record_total_mib = 4096;
  uint64_t record_file_mib = 256;
  uint64_t record_age_h = 0;  // 0: never deleted for their age
  uint64_t record_reserve_mib = 1024;
  FaultPlan fault;
};

struct Serve {
  Flags flags;
};
struct ReportDevices {
  Flags flags;
  bool json = false;
};
// `sightlined demo`: the process becomes the command `sightline demo`, which stands beside it.
struct BecomeDemo {
  std::vector<std::string> arguments;
};
// Ask the running daemon how it is.
struct CheckHealth {
  Flags flags;          // for the daemon's address
  std::string address;  // instead of the daemon's own; empty: none
  bool tls = false;     // TCP is encrypted there; it is in any case when the daemon's flags name a certificate
  bool alive = false;   // ask for liveness instead of readiness
};
// Try whether the daemon can start with these flags.
struct CheckConfig {
  Flags flags;
};
// The process ends with this code. Help, version, configuration or error have been printed.
struct Exit {
  int code = 0;
};
using Command = std::variant<Serve, ReportDevices, CheckHealth, CheckConfig, BecomeDemo, Exit>;

// Knows all flags. Making one takes far longer than parsing a command line with it. Not thread-safe.
class CommandLine {
 public:
  CommandLine();
  ~CommandLine();

  // Reads the arguments and the file named by --config. Wrong flags print the reason to the standard error output and
  // give Exit{2}. It can be called again; nothing of a former command line remains.
  Command parse(int argc, const char* const* argv);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// The same for one command line.
Command parse_command_line(int argc, const char* const* argv);

}  // namespace sightline
