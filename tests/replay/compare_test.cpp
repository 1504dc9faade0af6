// Compares messages with messages, and recordings with recordings.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/recordings/reply_fields.h"
#include "client/replay/compare_command.h"
#include "client/replay/compare_recordings.h"
#include "tests/replay/recorded_hall.h"
#include "tests/replay/replayed.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using test::open_recording;
using test::record_hall;
using test::RecordedHall;
using test::rewritten;
using testing::HasSubstr;

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

TEST(CompareMessages, LooksAtBitsInLists) {
  v1::Transforms a, b;
  a.add_positions(0.0);
  b.add_positions(-0.0);
  ASSERT_TRUE(first_difference(a, b, {}));
  EXPECT_EQ(first_difference(a, b, {})->path, "positions[0]");
}

TEST(CompareMessages, LooksAtBitsOfFloats) {
  v1::Transforms a, b;
  a.add_velocities(0.0f);
  b.add_velocities(-0.0f);
  ASSERT_TRUE(first_difference(a, b, {}));
  EXPECT_EQ(first_difference(a, b, {})->path, "velocities[0]");
  a.set_velocities(0, NAN);
  b.set_velocities(0, NAN);
  EXPECT_FALSE(first_difference(a, b, {}));
}

// A file whose schema for replies is this program's, without what `change` takes out of the messages of session.proto.
McapInfo file_of_an_older_server(const std::function<void(google::protobuf::DescriptorProto&)>& change) {
  google::protobuf::FileDescriptorSet files;
  const auto& session = *v1::CameraReply::descriptor()->file();
  for (int i = 0; i < session.dependency_count(); ++i) session.dependency(i)->CopyTo(files.add_file());
  session.CopyTo(files.add_file());
  for (auto& message : *files.mutable_file(files.file_size() - 1)->mutable_message_type()) change(message);
  mcap::Schema schema;
  schema.id = 1, schema.name = "sightline.v1.CameraReply", schema.encoding = "protobuf",
  schema.data = files.SerializeAsString();
  McapInfo file;
  file.schemas[1] = schema;
  return file;
}

TEST(CompareReplies, FieldsThatAnOlderServerDidNotKnowDoNotCount) {
  const McapInfo file = file_of_an_older_server([](google::protobuf::DescriptorProto& message) {
    if (message.name() == "RelativePose") message.mutable_field()->RemoveLast();
  });
  const IgnoredFields unknown = reply_fields_unknown_to(file);
  v1::CameraReply old;
  old.mutable_relative_pose()->set_target_id(1);
  old.mutable_relative_pose()->mutable_pose()->mutable_position()->set_x(2);
  v1::CameraReply now = old;
  now.mutable_relative_pose()->mutable_unrotated_pose()->mutable_position()->set_x(3);
  ReplyComparison strict({}), fair({}, unknown);
  EXPECT_THAT(fair.unknown(), testing::ElementsAre("sightline.v1.RelativePose.unrotated_pose"));
  EXPECT_FALSE(strict.add(old, now));
  EXPECT_TRUE(fair.add(old, now));
  EXPECT_EQ(fair.hash_a(), fair.hash_b());
  now.mutable_relative_pose()->mutable_pose()->mutable_position()->set_x(4);
  EXPECT_FALSE(fair.add(old, now));
  EXPECT_EQ(fair.first()->field.path, "relative_pose.pose.position.x");
}

// Two replies to one tick, whose cameras are 3 m and a quarter turn apart. The targets stand in another order.
TEST(CompareReplies, TheLargestDistancesOfPosesAndSharesAreTold) {
  v1::CameraReply a, b;
  const auto add_target = [](v1::CameraReply& reply, uint64_t id, double share) {
    reply.add_targets()->set_id(id);
    reply.mutable_targets(reply.targets_size() - 1)->set_visible_share(share);
  };
  a.set_sequence(4), b.set_sequence(4);
  a.mutable_pose()->mutable_rotation()->set_w(1);
  b.mutable_pose()->mutable_rotation()->set_y(std::sqrt(0.5)),
      b.mutable_pose()->mutable_rotation()->set_w(std::sqrt(0.5));
  v1::Vec3& place = *b.mutable_pose()->mutable_position();
  place.set_x(1), place.set_y(-2), place.set_z(2);
  add_target(a, 1, 0.5), add_target(a, 2, 0.25);
  add_target(b, 2, 0.375), add_target(b, 1, 1.0);

  ReplyComparison comparison(gltf_convention());
  EXPECT_FALSE(comparison.add(a, b));
  EXPECT_NEAR(comparison.position_m(), 3.0, 1e-12);
  EXPECT_NEAR(comparison.direction_deg(), 90.0, 1e-9);
  EXPECT_EQ(comparison.visible_share(), 0.5) << "of one target in both";
  const auto of_shares = [&] {
    for (const FieldDeviation& deviation : comparison.deviations())
      if (deviation.field == "targets[].visible_share") return deviation;
    return FieldDeviation();
  };
  EXPECT_EQ(of_shares().replies, 1u) << "the elements of a list count once a reply";
  EXPECT_EQ(of_shares().largest, 0.75) << "of the elements at one place of the lists";

  a.set_sequence(5), b.set_sequence(5);
  b.mutable_targets(1)->set_visible_share(0.75);
  *b.mutable_pose() = a.pose();
  EXPECT_FALSE(comparison.add(a, b));
  EXPECT_EQ(of_shares().replies, 2u);
  EXPECT_EQ(of_shares().first_sequence, 4u);
  EXPECT_EQ(of_shares().largest, 0.75);
  EXPECT_NEAR(comparison.position_m(), 3.0, 1e-12) << "of all replies";
  EXPECT_NEAR(comparison.direction_deg(), 90.0, 1e-9);
  EXPECT_EQ(comparison.visible_share(), 0.5);
}

TEST(CompareReplies, EveryFieldCountsInAFileOfThisVersionAndInOneWithoutSchemas) {
  EXPECT_THAT(reply_fields_unknown_to(file_of_an_older_server([](google::protobuf::DescriptorProto&) {})),
              testing::IsEmpty());
  EXPECT_THAT(reply_fields_unknown_to({}), testing::IsEmpty());
}

TEST(CompareMessages, AFieldOfAnotherVersionHasItsNumber) {
  v1::CameraReply a, b;
  auto& unknown = *b.GetReflection()->MutableUnknownFields(&b);
  unknown.AddVarint(900, 7);
  const auto added = first_difference(a, b, {});
  ASSERT_TRUE(added);
  EXPECT_EQ(added->path, "900");
  EXPECT_EQ(added->a, "absent");
  EXPECT_EQ(added->b, "unknown");
  a.GetReflection()->MutableUnknownFields(&a)->AddVarint(900, 8);
  ASSERT_TRUE(first_difference(a, b, {}));
  EXPECT_EQ(first_difference(a, b, {})->path, "900");
}

TEST(CompareMessages, WhatOnlyOneHasIsNamed) {
  v1::CameraReply a, b;
  a.add_targets()->set_visible_share(0.5f);
  b = a;
  b.add_targets()->set_id(7);
  b.mutable_pose()->mutable_position()->set_x(2);
  b.set_merged_ticks(3);
  std::vector<std::string> paths;
  for_each_difference(a, b, {}, [&](const FieldDifference& difference) {
    paths.push_back(difference.path + ": " + difference.a + ", " + difference.b);
  });
  EXPECT_THAT(paths, testing::UnorderedElementsAre("targets[1]: absent, id: 7", "pose: absent, position { x: 2 }",
                                                   "merged_ticks: 0, 3"));
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
  // Passes every reply to `change`, which may alter it; a reply for which it returns false is left out.
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

TEST_F(CompareRecordings, CommandListsEveryFieldThatDiffers) {
  const test::TemporaryFolder folder;
  const std::string a = folder / "a.mcap", b = folder / "b.mcap";
  std::ofstream(a, std::ios::binary) << hall();
  std::ofstream(b, std::ios::binary) << rewritten(hall(), [](RecordedEvent& event, RecordingWriter& writer) {
    auto* reply = std::get_if<v1::CameraReply>(&event.message);
    if (!reply) return true;
    v1::Vec3& place = *reply->mutable_pose()->mutable_position();
    if (reply->sequence() == 10) place.set_x(place.x() + 0.25);
    if (reply->sequence() == 20) place.set_x(place.x() + 0.5), reply->set_cut(true);
    v1::Gap gap;
    gap.set_messages(3);
    return reply->sequence() != 30 || !writer.write(gap, event.log_ns).has_value();
  });
  std::ostringstream words, err;
  EXPECT_EQ(run_compare_command({.a = a, .b = b}, words, err), 1) << err.str();
  EXPECT_THAT(words.str(), HasSubstr("opening     equal\nticks       60 in both, 60 equal\n"));
  EXPECT_THAT(words.str(), HasSubstr("replies     59 in both, 57 equal, 1 only in A\n"));
  EXPECT_THAT(words.str(), HasSubstr("gaps        0 messages are missing in A, 3 in B\n"));
  EXPECT_THAT(words.str(), HasSubstr("at most     camera 0.5 m and 0 degrees apart, visible shares 0\n"));
  EXPECT_THAT(words.str(), testing::ContainsRegex("field +replies +first tick +largest"));
  EXPECT_THAT(words.str(), testing::ContainsRegex("cut +1 +20 +-"));
  EXPECT_THAT(words.str(), testing::ContainsRegex("pose\\.position\\.x +2 +10 +0\\.5"));
  EXPECT_THAT(words.str(), HasSubstr("result      differs\n"));
}

TEST_F(CompareRecordings, CommandNamesWhatDiffersInTheOpening) {
  const test::TemporaryFolder folder;
  const auto keep = [&](const char* name, uint64_t seed) {
    std::ofstream(folder / name, std::ios::binary)
        << record_hall(*make_embree_sampler_device(), {.ticks = 2, .seed = seed}).bytes;
    return (folder / name).string();
  };
  std::ostringstream words, err;
  EXPECT_EQ(run_compare_command({.a = keep("a.mcap", 3), .b = keep("b.mcap", 5)}, words, err), 1) << err.str();
  EXPECT_THAT(words.str(), HasSubstr("opening     differs: seed: 3 in A, 5 in B\n"));
}

}  // namespace
}  // namespace sightline
