// Messages and recordings against each other; the reference for messages is protobuf's own differencer.
#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <sstream>

#include "client/replay/compare_command.h"
#include "client/replay/compare_recordings.h"
#include "tests/replay/recorded_hall.h"
#include "tests/replay/replayed.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;
using test::open_recording;
using test::record_hall;
using test::RecordedHall;
using test::rewritten;
using testing::HasSubstr;

// A stream of numbers that is the same on every run.
class Dice {
 public:
  explicit Dice(uint64_t seed) : engine_(seed) {}
  uint32_t below(uint32_t n) { return static_cast<uint32_t>(engine_() % n); }

 private:
  std::mt19937_64 engine_;
};

void set_any(Message& message, const FieldDescriptor& field, Dice& dice);

// Some fields of a message, at random, a few levels deep.
void fill(Message& message, Dice& dice, int depth) {
  const Descriptor& type = *message.GetDescriptor();
  const Reflection& reflection = *message.GetReflection();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    if (dice.below(3) == 0) continue;
    if (field.cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) {
      for (uint32_t k = field.is_repeated() ? dice.below(4) : 1; k > 0; --k) set_any(message, field, dice);
    } else if (depth > 0) {
      if (!field.is_repeated()) fill(*reflection.MutableMessage(&message, &field), dice, depth - 1);
      for (uint32_t k = field.is_repeated() ? dice.below(3) : 0; k > 0; --k)
        fill(*reflection.AddMessage(&message, &field), dice, depth - 1);
    }
  }
}

void set_any(Message& message, const FieldDescriptor& field, Dice& dice) {
  const Reflection& r = *message.GetReflection();
  const uint32_t value = 1 + dice.below(3);
  const bool list = field.is_repeated();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return list ? r.AddDouble(&message, &field, value) : r.SetDouble(&message, &field, value);
    case FieldDescriptor::CPPTYPE_FLOAT:
      return list ? r.AddFloat(&message, &field, static_cast<float>(value))
                  : r.SetFloat(&message, &field, static_cast<float>(value));
    case FieldDescriptor::CPPTYPE_UINT32:
      return list ? r.AddUInt32(&message, &field, value) : r.SetUInt32(&message, &field, value);
    case FieldDescriptor::CPPTYPE_UINT64:
      return list ? r.AddUInt64(&message, &field, value) : r.SetUInt64(&message, &field, value);
    case FieldDescriptor::CPPTYPE_INT32:
      return list ? r.AddInt32(&message, &field, 3)
                  : r.SetInt32(&message, &field, static_cast<int32_t>(value));
    case FieldDescriptor::CPPTYPE_BOOL:
      return list ? r.AddBool(&message, &field, true) : r.SetBool(&message, &field, value > 1);
    case FieldDescriptor::CPPTYPE_ENUM:
      return list ? r.AddEnumValue(&message, &field, 1)
                  : r.SetEnumValue(&message, &field, static_cast<int>(value % 2));
    case FieldDescriptor::CPPTYPE_STRING:
      return list ? r.AddString(&message, &field, "x") : r.SetString(&message, &field, std::to_string(value));
    default:
      FAIL() << "the messages of a session have no such field: " << field.full_name();
  }
}

// The paths that protobuf's differencer tells, in its own spelling, lists as a whole.
std::set<std::string> reference_paths(const Message& a, const Message& b) {
  class Collect final : public google::protobuf::util::MessageDifferencer::Reporter {
   public:
    using Path = std::vector<google::protobuf::util::MessageDifferencer::SpecificField>;
    explicit Collect(std::set<std::string>& paths) : paths_(paths) {}
    void ReportAdded(const Message&, const Message&, const Path& path) override { add(path, true); }
    void ReportDeleted(const Message&, const Message&, const Path& path) override { add(path, true); }
    // It tells every message on the way to what differs as well.
    void ReportModified(const Message&, const Message&, const Path& path) override {
      if (path.back().field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) add(path, false);
    }

   private:
    // Where a list is longer in one of them we name the list, the differencer each element.
    void add(const Path& path, bool only_one_has_it) {
      std::string text;
      for (const auto& step : path) {
        if (!text.empty()) text += '.';
        text += step.field->name();
        const bool list = only_one_has_it && &step == &path.back();
        if (step.field->is_repeated() && !list)
          text.append("[").append(std::to_string(step.index)).append("]");
      }
      paths_.insert(text);
    }
    std::set<std::string>& paths_;
  };
  std::set<std::string> paths;
  Collect collect(paths);
  google::protobuf::util::MessageDifferencer differencer;
  differencer.ReportDifferencesTo(&collect);
  differencer.Compare(a, b);
  return paths;
}

// Ours, without what lies below a message that only one of them has: the differencer stops there.
std::set<std::string> our_paths(const Message& a, const Message& b) {
  std::set<std::string> paths, present;
  for_each_difference(a, b, {}, [&](const FieldDifference& difference) {
    const std::string path = to_string(difference.path);
    for (const std::string& above : present)
      if (path.starts_with(above + ".")) return true;
    if (difference.a() == "present" || difference.b() == "present") present.insert(path);
    paths.insert(path);
    return true;
  });
  return paths;
}

template <typename Type>
void agree_with_the_reference(uint64_t seed) {
  Dice dice(seed);
  Type a, b;
  fill(a, dice, 4);
  b = a;
  EXPECT_EQ(first_difference(a, b, {}), std::nullopt);
  Dice other(seed + 1000);
  fill(b, other, 4);  // other values over some fields, longer lists
  EXPECT_EQ(our_paths(a, b), reference_paths(a, b)) << seed;
}

TEST(CompareMessages, TellsTheFieldsThatProtobufsOwnDifferencerTells) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    agree_with_the_reference<v1::CameraReply>(seed);
    agree_with_the_reference<v1::Tick>(seed);
    agree_with_the_reference<v1::OpenSession>(seed);
  }
}

TEST(CompareMessages, LooksAtBits) {
  v1::Vec3 a, b;
  a.set_x(0.1);
  b.set_x(std::nextafter(0.1, 1.0));
  const auto difference = first_difference(a, b, {});
  ASSERT_TRUE(difference);
  EXPECT_EQ(difference->path, "x");
  EXPECT_EQ(difference->a, "0.1");
  EXPECT_EQ(difference->b, "0.10000000000000002");
  a.set_x(0.0);
  b.set_x(-0.0);
  ASSERT_TRUE(first_difference(a, b, {}));
  EXPECT_EQ(first_difference(a, b, {})->b, "-0");
  a.set_x(NAN);
  b.set_x(NAN);
  EXPECT_FALSE(first_difference(a, b, {}));
}

TEST(CompareMessages, IgnoredFieldsDoNotCount) {
  v1::CameraReply a, b;
  a.mutable_stage_times()->set_total_us(1);
  a.mutable_flags();
  b.mutable_flags()->set_recording_degraded(true);
  EXPECT_FALSE(first_difference(a, b, fields_beside_the_reply()));
  EXPECT_EQ(reply_hash(a), reply_hash(b));
  b.mutable_flags()->set_degraded(true);
  EXPECT_EQ(first_difference(a, b, fields_beside_the_reply())->path, "flags.degraded");
  EXPECT_NE(reply_hash(a), reply_hash(b));
}

class CompareRecordings : public testing::Test {
 protected:
  static const std::string& hall() {
    static const std::string bytes = record_hall(*make_embree_sampler_device()).bytes;
    return bytes;
  }
  // Every reply changed by `change`, which answers false to leave it out.
  static std::string with_replies(const std::function<bool(v1::CameraReply&)>& change) {
    return rewritten(hall(), [&](RecordedEvent& event, RecordingWriter&) {
      auto* reply = std::get_if<v1::CameraReply>(&event.message);
      return !reply || change(*reply);
    });
  }
  static RecordingComparison compare(const std::string& a, const std::string& b) {
    const Recording recording_a = open_recording(a), recording_b = open_recording(b);
    return compare_recordings(recording_a, recording_b).value();
  }
};

TEST_F(CompareRecordings, OfOneAreEqual) {
  const RecordingComparison same = compare(hall(), hall());
  EXPECT_TRUE(same.equal());
  EXPECT_EQ(same.replies.compared(), 60u);
  EXPECT_EQ(same.input.equal, 60u);
  EXPECT_FALSE(same.input.opening);
  EXPECT_EQ(same.replies.hash_a(), same.replies.hash_b());
}

TEST_F(CompareRecordings, WhatReplaysMeasureAnewDoesNotCount) {
  EXPECT_TRUE(compare(hall(), with_replies([](v1::CameraReply& reply) {
                        reply.mutable_stage_times()->set_total_us(7);
                        return true;
                      }))
                  .equal());
}

TEST_F(CompareRecordings, DeviationsAreTheLargestOfAllReplies) {
  const RecordingComparison moved = compare(hall(), with_replies([](v1::CameraReply& reply) {
                                              const double x = reply.pose().position().x();
                                              if (reply.sequence() == 10)
                                                reply.mutable_pose()->mutable_position()->set_x(x + 0.25);
                                              if (reply.sequence() == 20)
                                                reply.mutable_pose()->mutable_position()->set_x(x - 0.5);
                                              if (reply.sequence() == 20) reply.set_cut(true);
                                              return true;
                                            }));
  EXPECT_FALSE(moved.equal());
  EXPECT_EQ(moved.replies.equal(), 58u);
  EXPECT_NEAR(moved.replies.position_m(), 0.5, 1e-12);
  EXPECT_EQ(moved.replies.direction_deg(), 0.0);
  const auto fields = moved.replies.deviations();
  ASSERT_EQ(fields.size(), 2u);
  EXPECT_EQ(fields[0].field, "cut");
  EXPECT_FALSE(fields[0].is_number);
  EXPECT_EQ(fields[1].field, "pose.position.x");
  EXPECT_EQ(fields[1].replies, 2u);
  EXPECT_EQ(fields[1].first_sequence, 10u);
  EXPECT_NEAR(fields[1].largest, 0.5, 1e-12);
  ASSERT_TRUE(moved.replies.first());
  EXPECT_EQ(moved.replies.first()->sequence, 10u);
  EXPECT_EQ(moved.replies.first()->field.path, "pose.position.x");
}

TEST_F(CompareRecordings, MatchesBySequence) {
  const std::string holes = with_replies([](v1::CameraReply& reply) { return reply.sequence() % 10 != 3; });
  const RecordingComparison one = compare(hall(), holes), other = compare(holes, hall());
  EXPECT_EQ(one.replies.compared(), 54u);
  EXPECT_EQ(one.replies.equal(), 54u);
  EXPECT_EQ(one.only_a, 6u);
  EXPECT_EQ(other.only_b, 6u);
  EXPECT_FALSE(one.equal());
  EXPECT_EQ(one.input.equal, 60u);
}

TEST_F(CompareRecordings, InputsThatDifferAreTold) {
  const std::string seed = record_hall(*make_embree_sampler_device(), {.seed = 5}).bytes;
  const RecordingComparison opening = compare(hall(), seed);
  ASSERT_TRUE(opening.input.opening);
  EXPECT_EQ(opening.input.opening->path, "seed");
  EXPECT_EQ(opening.input.equal, 60u);
  const std::string slower = rewritten(hall(), [](RecordedEvent& event, RecordingWriter&) {
    auto* tick = std::get_if<v1::Tick>(&event.message);
    if (tick && tick->sequence() >= 7) tick->mutable_transforms()->set_positions(4, 1.5);
    return true;
  });
  const RecordingComparison ticks = compare(hall(), slower);
  EXPECT_EQ(ticks.input.equal, 6u);
  ASSERT_TRUE(ticks.input.first);
  EXPECT_EQ(ticks.input.first->sequence, 7u);
  EXPECT_EQ(ticks.input.first->field.path, "transforms.positions[4]");
  EXPECT_EQ(ticks.input.first->field.b, "1.5");
}

TEST_F(CompareRecordings, CommandSaysItInWordsAndInJson) {
  const test::TemporaryFolder folder;
  const std::string a = folder / "a.mcap", b = folder / "b.mcap";
  std::ofstream(a, std::ios::binary) << hall();
  std::ofstream(b, std::ios::binary) << with_replies([](v1::CameraReply& reply) {
    if (reply.sequence() == 12) reply.set_status(v1::TRACKING_STATUS_HOLDING);
    return true;
  });
  std::ostringstream same, words, json, err;
  EXPECT_EQ(run_compare_command({.a = a, .b = a}, same, err), 0);
  EXPECT_THAT(same.str(), HasSubstr("result      equal"));
  EXPECT_EQ(run_compare_command({.a = a, .b = b}, words, err), 1);
  EXPECT_THAT(words.str(), HasSubstr("tick 12 at 0.183 s: status: "));
  EXPECT_THAT(words.str(), HasSubstr("HOLDING in B"));
  EXPECT_EQ(run_compare_command({.a = a, .b = b, .json = true}, json, err), 1);
  const auto read = nlohmann::json::parse(json.str());
  EXPECT_EQ(read["replies"]["equal"], 59);
  EXPECT_EQ(read["replies"]["first"]["field"], "status");
  EXPECT_EQ(read["replies"]["fields"][0]["replies"], 1);
  EXPECT_TRUE(read["input"]["first"].is_null());
  EXPECT_EQ(run_compare_command({.a = a, .b = folder / "none.mcap"}, words, err), 1);
  EXPECT_THAT(err.str(), HasSubstr("none.mcap"));
}

}  // namespace
}  // namespace sightline
