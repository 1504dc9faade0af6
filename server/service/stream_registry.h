// The open streams: it limits their number, and notifies them when the server shuts down.
#pragma once

#include <grpcpp/support/status.h>

#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/base/mutex.h"

namespace sightline {

// The registry's view of a stream. Both functions are called from any thread and return at once.
class Drainable {
 public:
  virtual ~Drainable() = default;
  // Notifies the client that the server is shutting down, and answers its messages until it closes its side.
  virtual void drain(const std::string& reason) = 0;
  // Closes as soon as no step and no write is under way.
  virtual void end(const grpc::Status& status) = 0;
};

enum class Admission { kAdmitted, kFull, kClientFull, kDraining };
// "full", ...: for logs.
std::string to_string(Admission admission);

// Thread-safe.
class StreamRegistry {
 public:
  explicit StreamRegistry(size_t max_streams, size_t max_per_client = std::numeric_limits<size_t>::max())
      : max_streams_(max_streams), max_per_client_(max_per_client) {}

  // Counts the stream until it is removed. Streams are identified by their address.
  Admission add(const std::shared_ptr<Drainable>& stream, const std::string& client = {});
  // Lets a stream wait for a place (`move_place`) which `add` refused because of a limit. It may be about to resume a
  // session, which has a place already. A client may have as many waiting streams as places. False: the stream is
  // refused.
  bool add_waiting(const std::shared_ptr<Drainable>& stream, const std::string& client);
  void remove(const Drainable* stream);
  // `to` takes the place of `from`, and gives up one of its own if it has one. False: the server drains, or `from` has
  // none.
  bool move_place(const Drainable* from, const std::shared_ptr<Drainable>& to);

  // From now on no stream is admitted; every open stream is notified.
  void drain(const std::string& reason);
  void end_all(const grpc::Status& status);
  // Ends the streams of the clients that `may_stay` refuses; returns their number.
  size_t end_unless(const std::function<bool(const std::string& client)>& may_stay, const grpc::Status& status);

  // Places in use. Streams that wait for one are not counted.
  size_t size() const;
  size_t max_streams() const { return max_streams_; }
  size_t max_per_client() const { return max_per_client_; }

 private:
  std::vector<std::shared_ptr<Drainable>> alive() const;

  struct Entry {
    std::weak_ptr<Drainable> stream;
    std::string client;
    bool waiting = false;  // has no place
  };
  struct Count {
    size_t places = 0, waiting = 0;
    size_t& of(bool is_waiting) { return is_waiting ? waiting : places; }
  };
  using Entries = std::map<const Drainable*, Entry>;

  void insert(const std::shared_ptr<Drainable>& stream, const std::string& client, bool waiting) NEEDS(mutex_);
  void erase(Entries::iterator entry) NEEDS(mutex_);

  const size_t max_streams_, max_per_client_;
  mutable Mutex mutex_;
  bool draining_ GUARDED(mutex_) = false;
  Entries streams_ GUARDED(mutex_);
  std::map<std::string, Count> of_client_ GUARDED(mutex_);
  size_t places_ GUARDED(mutex_) = 0;
};

}  // namespace sightline
