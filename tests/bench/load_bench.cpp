// Loads scenes of several sizes and prints for each part the seconds to load it and the bytes for each triangle.
//   load_bench [--csv FILE] [TRIANGLES ...]      by default 280000 2800000 10000000
// Wall-clock seconds are the least of three loads that use every core. Processor time is summed over all cores, and
// says more on a machine that does other work too. The file comes from the page cache. Bytes are what the parts report
// about themselves. "resident" is the growth of the process's resident memory after the file's own bytes have been
// freed.
#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "scenes/glb_writer.h"
#include "server/gl/software_renderer.h"
#include "server/sample/egl_sampler.h"
#include "server/sample/embree_sampler.h"
#include "server/scene/gltf.h"
#include "server/scene/mirror.h"

namespace sightline {
namespace {

constexpr int kLoads = 3;
constexpr int kBlocks = 64;

// A grid of n x n cells over a square of `size_m`, lifted by `height_m(x, z)`: 2 n^2 triangles.
MeshData height_field(uint32_t n, float size_m, const std::function<float(float, float)>& height_m) {
  MeshData mesh;
  for (uint32_t j = 0; j <= n; ++j)
    for (uint32_t i = 0; i <= n; ++i) {
      const float x = size_m * (static_cast<float>(i) / static_cast<float>(n) - 0.5f);
      const float z = size_m * (static_cast<float>(j) / static_cast<float>(n) - 0.5f);
      mesh.positions.push_back({x, height_m(x, z), z});
    }
  for (uint32_t j = 0; j < n; ++j)
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t a = j * (n + 1) + i, b = a + n + 1;
      mesh.indices.insert(mesh.indices.end(), {a, b, a + 1, a + 1, b, b + 1});
    }
  return mesh;
}

uint32_t cells_for(size_t triangles) {
  return static_cast<uint32_t>(std::lround(std::sqrt(0.5 * static_cast<double>(triangles))));
}

// Half of the triangles are in one landscape, half in 64 different meshes that stand on it. So the file is neither a
// single mesh nor one mesh for each core.
std::vector<std::byte> make_landscape(size_t triangles) {
  scenes::GlbWriter writer;
  const auto hills = [](float x, float z) { return 8.0f * std::sin(0.03f * x) * std::cos(0.041f * z); };
  const int ground = writer.add_mesh("ground", height_field(cells_for(triangles / 2), 600.0f, hills), glm::vec3(0.4f));
  writer.add_node({.name = "ground", .mesh = ground, .extras = {}});
  for (int block = 0; block < kBlocks; ++block) {
    const float phase = static_cast<float>(block);
    const auto dome = [phase](float x, float z) {
      return 12.0f - 0.08f * (x * x + z * z) + 0.3f * std::sin(1.7f * x + phase) * std::sin(2.3f * z - phase);
    };
    const int mesh = writer.add_mesh("block", height_field(cells_for(triangles / (2 * kBlocks)), 24.0f, dome),
                                     glm::vec3(0.6f));
    const glm::dvec3 place(70.0 * (block % 8 - 3.5), 4.0, 70.0 * (block / 8 - 3.5));
    writer.add_node({.name = "block", .mesh = mesh, .translation_m = place, .extras = {}});
  }
  return writer.finish("");
}

struct Seconds {
  double wall = 0.0, cpu = 0.0;

  static Seconds now() {
    const auto wall = std::chrono::steady_clock::now().time_since_epoch();
    return {std::chrono::duration<double>(wall).count(), static_cast<double>(std::clock()) / CLOCKS_PER_SEC};
  }
  Seconds operator-(const Seconds& start) const { return {wall - start.wall, cpu - start.cpu}; }
};
Seconds least(const Seconds& a, const Seconds& b) {
  return {std::min(a.wall, b.wall), std::min(a.cpu, b.cpu)};
}

[[noreturn]] void give_up(const std::string& why) {
  std::fprintf(stderr, "load_bench: %s\n", why.c_str());
  std::exit(1);
}

size_t resident_bytes() {
  malloc_trim(0);
  std::ifstream statm("/proc/self/statm");
  size_t pages = 0, resident = 0;
  statm >> pages >> resident;
  return resident * static_cast<size_t>(sysconf(_SC_PAGESIZE));
}

struct Scene {
  GeometryStore store;
  std::shared_ptr<const SceneAsset> asset;
  SceneMirror mirror;
};

// File to asset to mirror, as a session opens a scene.
Seconds load_scene(const std::string& path, Scene& scene) {
  const Seconds start = Seconds::now();
  auto asset = read_gltf_file(path, scene.store);
  if (!asset) give_up(to_string(asset.error()));
  scene.asset = *asset;
  auto instances = instantiate(*scene.asset, {}, scene.store);
  if (!instances) give_up(to_string(instances.error()));
  SceneDelta delta;
  delta.add = std::move(*instances);
  delta.asset_ids_allowed = true;
  if (const auto ok = scene.mirror.apply(delta, {}); !ok) give_up(to_string(ok.error()));
  return Seconds::now() - start;
}

// A map that meets every instance: what a sampler builds at its first take.
Seconds first_take(SamplerDevice& device, const SceneMirror& mirror) {
  const auto sampler = device.make_sampler();
  std::vector<MapRequest> requests(1);
  requests[0].view.eye_m = {0, 900, 0};
  requests[0].view.world_from_view = glm::mat3_cast(look_rotation({0, -1, 0}, {0, 0, 1}, {1, 0, 0}));
  requests[0].view.left = requests[0].view.bottom = -0.5;
  requests[0].view.right = requests[0].view.top = 0.5;
  requests[0].view.width = requests[0].view.height = 64;  // several samples on every block
  std::vector<DepthMap> maps;
  const Seconds start = Seconds::now();
  if (const auto ok = sampler->take(mirror, requests, maps); !ok) give_up(to_string(ok.error()));
  return Seconds::now() - start;
}

double each(size_t bytes, size_t triangles) {
  return static_cast<double>(bytes) / static_cast<double>(triangles);
}

void print_bytes(const char* part, size_t bytes, size_t triangles) {
  std::printf("  %-32s %37.1f bytes a triangle\n", part, each(bytes, triangles));
}
void print_time(const char* part, const Seconds& seconds) {
  std::printf("  %-32s %9.3f s %9.3f s of processor time\n", part, seconds.wall, seconds.cpu);
}

void measure_sampler(const char* name, SamplerDevice& device, const SceneMirror& mirror, size_t triangles,
                     std::FILE* csv) {
  const size_t before = resident_bytes();
  const Seconds took = first_take(device, mirror);
  const size_t resident = std::max(resident_bytes(), before) - before;
  print_time(name, took);
  print_bytes("  as it says", device.geometry_bytes(), triangles);
  print_bytes("  resident", resident, triangles);
  if (csv)
    std::fprintf(csv, ",%.4f,%.2f,%.2f", took.wall, each(device.geometry_bytes(), triangles),
                 each(resident, triangles));
}

// Each part's columns are written by the child that measured it.
constexpr const char* kColumns =
    "triangles,file_mb,scene_s,scene_cpu_s,source_bytes,cluster_bytes,scene_resident,embree_s,embree_bytes,embree_"
    "resident,egl_s,"
    "egl_bytes,egl_resident\n";

void measure(const std::string& path, std::FILE* csv, const std::function<void(const SceneMirror&, size_t)>& take) {
  // Memory is measured at the first load, because later ones reuse memory that it freed.
  const size_t before = resident_bytes();
  auto scene = std::make_unique<Scene>();
  Seconds best = load_scene(path, *scene);
  const size_t grown = resident_bytes() - before, triangles = scene->asset->triangle_count();
  for (int i = 1; i < kLoads; ++i) {
    scene = std::make_unique<Scene>();
    best = least(best, load_scene(path, *scene));
  }
  const GeometryBytes bytes = scene->store.live_bytes_by_part();
  std::printf("%zu triangles, file of %.1f bytes a triangle\n", triangles,
              each(std::filesystem::file_size(path), triangles));
  print_time("scene, ready to be sampled", best);
  print_bytes("  positions and indices", bytes.source, triangles);
  print_bytes("  clusters and their tree", bytes.clusters, triangles);
  print_bytes("  resident", grown, triangles);
  if (csv)
    std::fprintf(csv, "%zu,%.2f,%.4f,%.4f,%.2f,%.2f,%.2f", triangles,
                 1e-6 * static_cast<double>(std::filesystem::file_size(path)), best.wall, best.cpu,
                 each(bytes.source, triangles), each(bytes.clusters, triangles), each(grown, triangles));
  take(scene->mirror, triangles);
}

// Each part runs in a child process, so that memory which one part leaves behind does not count for the next.
void in_child(const std::function<void()>& work) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) give_up("cannot fork");
  if (child == 0) {
    work();
    std::fflush(nullptr);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (status != 0) give_up("a part failed");
}

void measure_size(size_t triangles, std::FILE* csv) {
  const std::string path = (std::filesystem::temp_directory_path() /
                            ("load_bench_" + std::to_string(getpid()) + ".glb"));
  in_child([&] {
    const std::vector<std::byte> bytes = make_landscape(triangles);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  });
  in_child([&] {
    measure(path, csv, [&](const SceneMirror& mirror, size_t count) {
      measure_sampler("Embree, first map", *make_embree_sampler_device(), mirror, count, csv);
    });
  });
  in_child([&] {
    measure(path, nullptr, [&](const SceneMirror& mirror, size_t count) {
      prepare_software_rendering();
      auto device = make_egl_sampler_device({});
      if (!device) return void(std::printf("  EGL: not measured, no context\n"));
      measure_sampler("EGL, first map", **device, mirror, count, csv);
    });
  });
  if (csv) std::fputc('\n', csv);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  std::vector<size_t> sizes;
  std::FILE* csv = nullptr;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--csv" && i + 1 < argc)
      csv = std::fopen(argv[++i], "w");
    else
      sizes.push_back(std::strtoull(argv[i], nullptr, 10));
  }
  if (sizes.empty()) sizes = {280'000, 2'800'000, 10'000'000};
  if (csv) std::fputs(sightline::kColumns, csv);
  for (const size_t triangles : sizes) sightline::measure_size(triangles, csv);
  if (csv) std::fclose(csv);
}
