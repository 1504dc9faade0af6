#include "server/wire/settings_to_proto.h"

namespace sightline {

v1::Lens lens_to_proto(const Lens& lens, const Convention& convention) {
  v1::Lens out;
  out.set_field_of_view(fov_to_client(convention, lens.vertical_fov_rad, lens.aspect));
  out.set_aspect(lens.aspect);
  out.set_near_m(lens.near_m);
  return out;
}

}  // namespace sightline
