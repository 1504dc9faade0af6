// A clock for what is read again when it has settled (server/gate/settled_files.h).
#pragma once

#include "server/gate/settled_files.h"

namespace sightline::test {

class SettlingClock {
 public:
  // Lets the files settle: two looks, far enough apart. Returns the result of the second.
  template <typename Reload>
  auto settle(const Reload& reload) {
    (void)reload(now_ += SettledFiles::kSettle);
    return reload(now_ += SettledFiles::kSettle);
  }

 private:
  SettledFiles::Time now_{};
};

}  // namespace sightline::test
