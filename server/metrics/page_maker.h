// Makes the pages that take longer, on a thread of its own, so that no other page waits for them.
//
// However often it is asked, it works for a quarter of the time at most. All who ask before a page is begun get the
// same one.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/base/mutex.h"

namespace sightline {

struct HttpAnswer {
  int status = 200;
  std::string body;
  std::string_view content_type = "text/plain; charset=utf-8";
};

using MakePage = std::function<HttpAnswer()>;
// Status 500 if it throws.
HttpAnswer made(const MakePage& make);

// Thread-safe.
class PageMaker {
 public:
  struct Made {
    uint64_t number;  // which `ask` has returned
    std::shared_ptr<const HttpAnswer> answer;
  };

  // `tell` is called on the maker's thread whenever a page is there to be taken.
  explicit PageMaker(std::function<void()> tell);
  // Waits for the page that is being made.
  ~PageMaker();
  PageMaker(const PageMaker&) = delete;
  PageMaker& operator=(const PageMaker&) = delete;

  // Has a page made, and returns at once. `page` must outlive the maker.
  uint64_t ask(const MakePage& page);
  // The pages that were made since the last call.
  std::vector<Made> take();

 private:
  struct Job {
    uint64_t number;
    const MakePage* page;
  };
  void make_one(const Job& job);
  void run();

  const std::function<void()> tell_;
  Mutex mutex_;
  ConditionVariable changed_;
  std::deque<Job> asked_ GUARDED(mutex_);
  std::vector<Made> made_ GUARDED(mutex_);
  uint64_t last_number_ GUARDED(mutex_) = 0;
  bool stopping_ GUARDED(mutex_) = false;

  std::thread thread_;
};

}  // namespace sightline
