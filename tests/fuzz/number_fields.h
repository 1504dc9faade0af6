// Every numeric field of a message type, found in its descriptors, and the values that are tried in it. So no test
// lists fields.
#pragma once

#include <google/protobuf/message.h>

#include <functional>
#include <string>
#include <vector>

#include "server/base/random.h"

namespace sightline::test {

// The way from a message down to one of its numbers.
struct NumberField {
  std::vector<const google::protobuf::FieldDescriptor*> way;
  std::string path() const;  // "settings.min_distance_m"
};

// Every number below a message of this type. Messages that hold their own type are entered twice.
std::vector<NumberField> number_fields(const google::protobuf::Descriptor& type);

// Fills a message that the way leads through and that was absent, so that it is accepted apart from the number.
using FillUsual = std::function<void(google::protobuf::Message&)>;

// Sets the number to an ordinary or an extreme value: 0, a number that is not normal, the ends of the annotated range
// and their neighbours, any power of ten, the present value scaled, or one that is not finite. Of a list it sets any
// element. Returns the value, for people.
std::string set_number(google::protobuf::Message& message, const NumberField& field, CounterRandom& random,
                       const FillUsual& fill_usual);

// The path of the first number below the message that is not finite, although it must be; empty: all are as they must
// be.
std::string not_finite_in(const google::protobuf::Message& message);

}  // namespace sightline::test
