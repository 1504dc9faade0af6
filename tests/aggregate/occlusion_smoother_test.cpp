#include "server/aggregate/occlusion_smoother.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>

#include "server/base/random.h"

namespace sightline {
namespace {

// The bound moves over the lattice. The reference keeps a low-pass value for each lattice point and drops it when the
// point is out of the bound for a step.
TEST(OcclusionSmoother, AreALowPassAndStartAgain) {
  CounterRandom random(81, 0, RandomPurpose::kTest);
  using Key = std::array<long, 3>;
  Lattice lattice;
  Bound bound;
  bound.radius_m = 1.0;
  OcclusionSmoother smoother;
  std::map<Key, double> past;
  std::array<double, 2> travellers{};
  int back = 0;
  for (int step = 0; step < 200; ++step) {
    bound.center_m += glm::dvec3(random.next_in(-0.3, 0.3), 0, random.next_in(-0.3, 0.3));
    lattice.cover(bound, 60);
    std::vector<double> hidden;
    for (size_t i = 0; i < lattice.positions_m().size() + 2; ++i) hidden.push_back(random.next_unit());
    const double dt_s = random.next_in(0.0, 0.1), memory_s = step % 20 == 0 ? 0.0 : 0.3;
    const std::vector<double> given = hidden;
    smoother.update(lattice, dt_s, memory_s, hidden);
    std::map<Key, double> now;
    const auto next = [&](double before, double share) {
      return memory_s == 0 ? share : share + (before - share) * std::exp(-dt_s / memory_s);
    };
    for (size_t i = 0; i < lattice.positions_m().size(); ++i) {
      const glm::dvec3 cell = glm::round(lattice.positions_m()[i] / lattice.spacing_m());
      const Key key = {std::lround(cell.x), std::lround(cell.y), std::lround(cell.z)};
      const auto before = past.find(key);
      now[key] = next(before == past.end() ? given[i] : before->second, given[i]);
      ASSERT_NEAR(hidden[i], now[key], 1e-12) << "step " << step;
      back += before == past.end();
    }
    for (size_t k = 0; k < 2; ++k) {
      const double seen = given[given.size() - 2 + k];
      travellers[k] = next(step == 0 ? seen : travellers[k], seen);
      ASSERT_NEAR(hidden[hidden.size() - 2 + k], travellers[k], 1e-12);
    }
    past = now;
  }
  EXPECT_GT(back, 300);
}

}  // namespace
}  // namespace sightline
