// Tells systemd how the daemon is, when systemd started it with Type=notify. Otherwise nothing happens.
#pragma once

namespace sightline {

void notify_ready();
void notify_stopping();
// Must come more often than WatchdogSec of the unit, or systemd restarts the daemon.
void notify_alive();

}  // namespace sightline
