#include "server/preparation.h"

#include <sys/mman.h>

#include <chrono>
#include <cmath>
#include <iostream>
#include <utility>

#include "server/base/cpu_budget.h"

namespace sightline {
namespace {

// What a start takes, with room to load scenes; and what each stepping thread adds, with those of the libraries.
constexpr size_t kAddressSpace = size_t{1} << 30, kAddressSpaceOfThread = size_t{160} << 20;

// Libraries end the process without a word when they get no memory or no thread at the start, so that is tried out
// before. The stacks and heaps of threads take address space, which `ulimit -v` limits, rather than memory.
Status try_address_space(const Flags& flags) {
  const size_t threads = flags.threads > 0 ? flags.threads : static_cast<size_t>(cpu_budget());
  const size_t bytes = kAddressSpace + threads * kAddressSpaceOfThread;
  void* const space = ::mmap(nullptr, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (space == MAP_FAILED)
    return fail(ErrorCode::kResourceExhausted, "",
                "out of memory: the process may not use " + std::to_string(bytes >> 20) + " MiB of address space");
  ::munmap(space, bytes);
  return {};
}

CredentialFiles credential_files(const Flags& flags) {
  return {.access = flags.access_file, .tls = {flags.tls_cert, flags.tls_key, flags.tls_client_ca}};
}

Status check_addresses(const Flags& flags, const Credentials& credentials) {
  if (Status ok = Listener::check(listen_addresses(flags, credentials)); !ok) return ok;
  if (flags.metrics_listen == "none") return {};
  const auto known = ListeningSocket::stays_on_host(flags.metrics_listen, "--metrics-listen");
  return known ? Status{} : tl::unexpected(known.error());
}

}  // namespace

EglOptions egl_options(const Flags& flags) {
  return {.device_index = flags.egl_device, .require_gpu = flags.require_gpu};
}

ListenOptions listen_addresses(const Flags& flags, const Credentials& credentials) {
  ListenOptions options;
  options.tcp = flags.listen == "none" ? "" : flags.listen;
  options.unix_path = flags.listen_unix;
  options.unix_mode = flags.unix_mode;
  options.tls = credentials.tls();
  options.callers_are_known = !flags.access_file.empty() || !flags.tls_client_ca.empty();
  options.allow_insecure_network = flags.allow_insecure_network;
  return options;
}

tl::expected<Preparation, StartTrouble> prepare(const Flags& flags) {
  const auto trouble = [](Error error, const char* advice) {
    return tl::unexpected(StartTrouble{std::move(error), advice});
  };
  if (Status space = try_address_space(flags); !space)
    return trouble(std::move(space.error()), "raise `ulimit -v`, or lower --threads");
  Preparation made;
  auto credentials = Credentials::load(credential_files(flags));
  if (!credentials) return trouble(std::move(credentials.error()), "deploy/SECURITY.md describes the files");
  made.credentials = std::move(*credentials);
  if (Status addresses = check_addresses(flags, *made.credentials); !addresses)
    return trouble(std::move(addresses.error()),
                   "choose another address; deploy/SECURITY.md says what one that others reach needs");
  auto chosen = choose_sampler_device(flags.sampler, egl_options(flags), 1,
                                      std::chrono::nanoseconds(std::llround(flags.max_maps_ms * 1e6)));
  if (!chosen) return trouble(std::move(chosen.error()), "see `sightlined devices`; --sampler embree needs no OpenGL");
  made.chosen = std::move(*chosen);
  if (flags.fault.kind == FaultKind::kNone) return made;
  auto faulty = make_faulty_device(*made.chosen.device, flags.fault);
  if (!faulty) return trouble(std::move(faulty.error()), "this flag is for tests and drills only");
  made.faulty = std::move(*faulty);
  return made;
}

int check_configuration(const Flags& flags) {
  constexpr int kNotValid = 2;
  const auto made = prepare(flags);
  if (!made) {
    std::cerr << to_string(made.error().error) << "\nThe daemon would not start: " << made.error().advice << ".\n";
    return kNotValid;
  }
  for (const std::string& exposed : made->credentials->exposed())
    std::cerr << "warning: " << exposed << ": " << kExposedAdvice << '\n';
  std::cout << "the configuration is valid\n";
  return 0;
}

}  // namespace sightline
