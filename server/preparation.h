// What the daemon makes of its flags before it listens. The start and --check-config both do it, so that they judge
// alike.
#pragma once

#include <memory>
#include <string>

#include "server/base/error.h"
#include "server/flags.h"
#include "server/gate/credentials.h"
#include "server/sample/sampler_choice.h"
#include "server/service/listener.h"

namespace sightline {

struct Preparation {
  std::unique_ptr<Credentials> credentials;
  ChosenSampler chosen;
  std::unique_ptr<SamplerDevice> faulty;  // null: no faults are injected

  SamplerDevice& sampler() const { return faulty ? *faulty : *chosen.device; }
};

struct StartTrouble {
  Error error;
  std::string advice;
};

// Fails where the daemon cannot start with these flags on this machine: too little address space, files that cannot be
// used, addresses that are not valid or may not be opened to a network, no such device. It takes no address, so it does
// not see that one is in use.
tl::expected<Preparation, StartTrouble> prepare(const Flags& flags);

// Prints whether the daemon can start with these flags, and what it would warn of. Returns the exit status: 0 or 2.
int check_configuration(const Flags& flags);

EglOptions egl_options(const Flags& flags);
// Where to listen, and what is known of callers there.
ListenOptions listen_addresses(const Flags& flags, const Credentials& credentials);
// What to do about Credentials::exposed.
inline constexpr char kExposedAdvice[] = "take the right from them with chmod";

}  // namespace sightline
