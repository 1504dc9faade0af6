#include "server/metrics/page_maker.h"

#include <sys/prctl.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <new>
#include <utility>

namespace sightline {
namespace {

using std::chrono::steady_clock;

// How long the maker rests after a page, in times of what it took.
constexpr int kRest = 3;
// So that a page which waited for a lock does not make the next one late.
constexpr std::chrono::milliseconds kLongestRest{100};

}  // namespace

HttpAnswer made(const MakePage& make) try { return make(); } catch (const std::exception&) {
  return {.status = 500, .body = "The page could not be made.\n"};
}

PageMaker::PageMaker(std::function<void()> tell) : tell_(std::move(tell)), thread_([this] { run(); }) {}

PageMaker::~PageMaker() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

uint64_t PageMaker::ask(const MakePage& page) {
  const MutexLock lock(mutex_);
  const auto same = std::find_if(asked_.begin(), asked_.end(), [&](const Job& job) { return job.page == &page; });
  if (same != asked_.end()) return same->number;
  asked_.push_back({++last_number_, &page});
  changed_.notify_all();
  return last_number_;
}

std::vector<PageMaker::Made> PageMaker::take() {
  const MutexLock lock(mutex_);
  return std::exchange(made_, {});
}

// Without memory there is no page. Those who wait for it give up in time.
void PageMaker::make_one(const Job& job) try {
  const auto answer = std::make_shared<const HttpAnswer>(made(*job.page));
  {
    const MutexLock lock(mutex_);
    made_.push_back({job.number, answer});
  }
  tell_();
} catch (const std::bad_alloc&) {
}

void PageMaker::run() {
  ::prctl(PR_SET_NAME, "page-maker");  // for ps and debuggers
  MutexLock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this]() NEEDS(mutex_) { return stopping_ || !asked_.empty(); });
    if (stopping_) return;
    const Job job = asked_.front();
    asked_.pop_front();
    lock.unlock();
    const auto begin = steady_clock::now();
    make_one(job);
    const auto took = steady_clock::now() - begin;
    lock.lock();
    changed_.wait_for(lock, std::min<steady_clock::duration>(kRest * took, kLongestRest),
                      [this]() NEEDS(mutex_) { return stopping_; });
  }
}

}  // namespace sightline
