// Places for streams, beside a plain list of who has one and who waits for one.
#include "server/service/stream_registry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "server/base/random.h"

namespace sightline {
namespace {

class NotedStream final : public Drainable {
 public:
  void drain(const std::string& reason) override { drained += reason; }
  void end(const grpc::Status& status) override { ended.push_back(status.error_code()); }
  std::string drained;
  std::vector<grpc::StatusCode> ended;
};

struct Listed {
  std::shared_ptr<NotedStream> stream;
  std::string client;
  bool waiting;
};

struct PlainRegistry {
  size_t most, most_of_client;
  std::vector<Listed> all = {};

  size_t count(const std::string& client, bool waiting) const {
    return static_cast<size_t>(std::count_if(all.begin(), all.end(), [&](const Listed& each) {
      return (client.empty() || each.client == client) && each.waiting == waiting;
    }));
  }
  Admission add(const std::shared_ptr<NotedStream>& stream, const std::string& client) {
    if (count("", false) >= most) return Admission::kFull;
    if (count(client, false) >= most_of_client) return Admission::kClientFull;
    all.push_back({stream, client, false});
    return Admission::kAdmitted;
  }
  bool add_waiting(const std::shared_ptr<NotedStream>& stream, const std::string& client) {
    if (count(client, true) >= count(client, false)) return false;
    all.push_back({stream, client, true});
    return true;
  }
  void remove(const NotedStream* stream) {
    std::erase_if(all, [&](const Listed& each) { return each.stream.get() == stream; });
  }
  void move_place(size_t from, const std::shared_ptr<NotedStream>& to) {
    const std::string client = all[from].client;
    remove(all[from].stream.get());
    remove(to.get());
    all.push_back({to, client, false});
  }
};

TEST(StreamRegistryTest, CountsPlacesAsAPlainListDoes) {
  CounterRandom random(11, 0, RandomPurpose::kTest);
  StreamRegistry registry(6, 4);
  PlainRegistry plain{6, 4};
  int refused = 0, waits = 0;
  for (int i = 0; i < 5000; ++i) {
    const std::string client(1, static_cast<char>('a' + random.next_below(3)));
    const auto fresh = std::make_shared<NotedStream>();
    const size_t some = plain.all.empty() ? 0 : random.next_below(static_cast<uint32_t>(plain.all.size()));
    switch (random.next_below(4)) {
      case 0: {
        const Admission expected = plain.add(fresh, client);
        ASSERT_EQ(registry.add(fresh, client), expected);
        refused += expected != Admission::kAdmitted;
        break;
      }
      case 1: {
        const bool expected = plain.add_waiting(fresh, client);
        ASSERT_EQ(registry.add_waiting(fresh, client), expected);
        waits += expected;
        break;
      }
      case 2:
        if (plain.all.empty()) break;
        registry.remove(plain.all[some].stream.get());
        plain.remove(plain.all[some].stream.get());
        break;
      default:
        ASSERT_FALSE(registry.move_place(fresh.get(), fresh)) << "it has none";
        const auto waiting = std::find_if(plain.all.begin(), plain.all.end(),
                                          [](const Listed& each) { return each.waiting; });
        if (waiting == plain.all.end() || plain.all[some].waiting || plain.all[some].client != waiting->client) break;
        const auto to = waiting->stream;
        ASSERT_TRUE(registry.move_place(plain.all[some].stream.get(), to));
        plain.move_place(some, to);
    }
    ASSERT_EQ(registry.size(), plain.count("", false));
  }
  EXPECT_GT(refused, 100);
  EXPECT_GT(waits, 100);
}

TEST(StreamRegistryTest, EndsThoseWhoMayNotStay) {
  StreamRegistry registry(10);
  const auto a = std::make_shared<NotedStream>(), b = std::make_shared<NotedStream>(),
             waits = std::make_shared<NotedStream>();
  registry.add(a, "a"), registry.add(b, "b"), registry.add_waiting(waits, "b");
  registry.add(std::make_shared<NotedStream>(), "b");  // it is gone
  const auto is_a = [](const std::string& client) { return client == "a"; };
  EXPECT_EQ(registry.end_unless(is_a, {grpc::StatusCode::UNAUTHENTICATED, ""}), 2u);
  EXPECT_TRUE(a->ended.empty());
  EXPECT_EQ(b->ended, std::vector{grpc::StatusCode::UNAUTHENTICATED});
  EXPECT_EQ(waits->ended, std::vector{grpc::StatusCode::UNAUTHENTICATED});
  registry.end_all({grpc::StatusCode::UNAVAILABLE, ""});
  EXPECT_EQ(a->ended, std::vector{grpc::StatusCode::UNAVAILABLE});
  EXPECT_EQ(b->ended.size(), 2u);
}

TEST(StreamRegistryTest, WhileItDrainsNoneIsAdmitted) {
  StreamRegistry registry(10);
  const auto a = std::make_shared<NotedStream>(), late = std::make_shared<NotedStream>();
  registry.add(a, "a");
  registry.drain("reason");
  EXPECT_EQ(a->drained, "reason");
  EXPECT_TRUE(a->ended.empty());
  EXPECT_EQ(registry.add(late, "a"), Admission::kDraining);
  EXPECT_FALSE(registry.add_waiting(late, "a"));
  EXPECT_FALSE(registry.move_place(a.get(), late));
  EXPECT_EQ(registry.size(), 1u);
}

}  // namespace
}  // namespace sightline
