// Settings come back unchanged from messages. Every field of the messages is set, so a new field cannot be forgotten.
#include "server/wire/settings_to_proto.h"

#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/wire/every_setting.h"

namespace sightline {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::util::MessageDifferencer;

// Sets every field of the message and of those within it, except the preset. Enums take their values in turn, never
// "unspecified".
void set_all(Message& message, std::mt19937& random) {
  const auto* reflection = message.GetReflection();
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor* field = message.GetDescriptor()->field(i);
    if (field->name() == "preset") continue;
    const uint32_t number = 1 + random() % 1000;
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_MESSAGE:
        set_all(*reflection->MutableMessage(&message, field), random);
        break;
      case FieldDescriptor::CPPTYPE_ENUM:
        reflection->SetEnumValue(&message, field,
                                 1 + static_cast<int>(number) % (field->enum_type()->value_count() - 1));
        break;
      case FieldDescriptor::CPPTYPE_BOOL:
        reflection->SetBool(&message, field, number % 2 == 0);
        break;
      case FieldDescriptor::CPPTYPE_UINT32:
        reflection->SetUInt32(&message, field, number);
        break;
      case FieldDescriptor::CPPTYPE_DOUBLE:
        reflection->SetDouble(&message, field, number / 1024.0);
        break;
      default:
        ADD_FAILURE() << "a type that this test does not know: " << field->full_name();
    }
  }
}

v1::OpenSession any_settings(std::mt19937& random) {
  v1::OpenSession open;
  set_all(*open.mutable_settings(), random), set_all(*open.mutable_tuning(), random);
  // The reader checks these four fields.
  open.mutable_settings()->set_framing_margin(0.3), open.mutable_settings()->set_dead_zone(0.2);
  open.mutable_settings()->set_min_vertical_fov_rad(0.5), open.mutable_settings()->set_max_vertical_fov_rad(1.5);
  return open;
}

TEST(SettingsToProto, EveryFieldComesBack) {
  std::mt19937 random(1);
  for (int i = 0; i < 50; ++i) {
    const v1::OpenSession sent = any_settings(random);
    StepSettings read;
    ASSERT_TRUE(read_settings(sent.settings(), sent.tuning(), "", read));
    EXPECT_TRUE(MessageDifferencer::Equals(test::wire_of(read), sent)) << test::text_of(read);
  }
}

TEST(SettingsToProto, PresetsAreGivenBackWithoutTheirName) {
  for (const auto preset : {v1::Settings::PRESET_SIGHTLINE, v1::Settings::PRESET_PAPER}) {
    v1::Settings named;
    named.set_preset(preset);
    StepSettings settings, again = preset_settings(Preset::kPaper);
    ASSERT_TRUE(read_settings(named, {}, "", settings));
    const v1::OpenSession sent = test::wire_of(settings);
    EXPECT_EQ(sent.settings().preset(), v1::Settings::PRESET_UNSPECIFIED);
    EXPECT_FALSE(sent.settings().has_min_vertical_fov_rad());
    ASSERT_TRUE(read_settings(sent.settings(), sent.tuning(), "", again));
    EXPECT_TRUE(MessageDifferencer::Equals(test::wire_of(again), sent));
  }
}

TEST(SettingsToProto, LimitsComeBack) {
  std::mt19937 random(2);
  v1::CameraLimits sent;
  set_all(sent, random);
  CameraLimits read;
  read_limits(sent, read);
  EXPECT_TRUE(MessageDifferencer::Equals(limits_to_proto(read), sent));
}

TEST(SettingsToProto, LensesComeBackInEachConvention) {
  const Lens lens{.vertical_fov_rad = 0.9, .aspect = 2.0, .near_m = 0.3};
  for (const Convention& convention : {gltf_convention(), unity_convention(), unreal_convention()}) {
    Lens read;
    ASSERT_TRUE(read_lens(lens_to_proto(lens, convention), convention, "lens", read));
    EXPECT_NEAR(read.vertical_fov_rad, lens.vertical_fov_rad, 1e-12);
    EXPECT_EQ(read.aspect, lens.aspect);
    EXPECT_EQ(read.near_m, lens.near_m);
  }
}

// 90 degrees wide at 16:9: tan(v / 2) = 9 / 16.
TEST(SettingsToProto, ALensIsInTheClientsAngle) {
  const Lens lens{.vertical_fov_rad = 2 * std::atan(9.0 / 16), .aspect = 16.0 / 9, .near_m = 0.2};
  const v1::Lens unreal = lens_to_proto(lens, unreal_convention()), gltf = lens_to_proto(lens, gltf_convention());
  EXPECT_NEAR(unreal.field_of_view(), 90, 1e-9);
  EXPECT_EQ(unreal.aspect(), 16.0 / 9);
  EXPECT_EQ(unreal.near_m(), 0.2);
  EXPECT_EQ(gltf.field_of_view(), lens.vertical_fov_rad);
}

}  // namespace
}  // namespace sightline
