#include "client/page/side_by_side.h"

namespace sightline {
namespace {

// For HTML text and attributes in double quotes.
std::string escaped(std::string_view text) {
  std::string out;
  out.reserve(text.size() + text.size() / 16);
  for (const char c : text) {
    if (c == '&')
      out.append("&amp;");
    else if (c == '"')
      out.append("&quot;");
    else if (c == '<')
      out.append("&lt;");
    else
      out.push_back(c);
  }
  return out;
}

constexpr char kHead[] = R"(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:">
<link rel="icon" href="data:,">
<style>
html, body { height: 100%; margin: 0; background: #101317; }
body { display: grid; grid-template-columns: 1fr 1fr; gap: 2px; }
iframe { width: 100%; height: 100%; border: 0; }
</style>
)";

// The pages are in frames of their own, so that each keeps its ids, keys and settings.
constexpr char kLink[] = R"(<script>
const frames = [...document.querySelectorAll('iframe')];
function ready() {
  return frames.every(({ contentWindow }) => contentWindow && contentWindow.sightline);
}
function link() {
  const pages = frames.map(({ contentWindow }) => contentWindow.sightline);
  const [a, b] = pages.map(({ session }) => session);
  const common = Math.max(a.start_s, b.start_s) <= Math.min(a.end_s, b.end_s);
  const later_s = common ? 0 : b.start_s - a.start_s;
  let leader = null;
  pages.forEach(({ player }, i) => {
    const other = pages[1 - i].player;
    player.onChange(() => {
      if (leader !== null && leader !== i) return;
      leader = i;
      other.pause();
      other.seekTime(player.session.time_s[player.frame] + (i === 0 ? later_s : -later_s));
      leader = null;
    });
  });
  pages[0].player.tell();
  document.body.dataset.ready = 'true';
}
const wait = setInterval(() => {
  if (!ready()) return;
  clearInterval(wait);
  link();
}, 50);
</script>
</body>
</html>
)";

}  // namespace

std::string side_by_side_page(std::string_view title, std::string_view left, std::string_view right) {
  std::string page = kHead;
  page.append("<title>").append(escaped(title)).append("</title>\n</head>\n<body>\n");
  page.append("<iframe title=\"Left\" srcdoc=\"").append(escaped(left)).append("\"></iframe>\n");
  page.append("<iframe title=\"Right\" srcdoc=\"").append(escaped(right)).append("\"></iframe>\n");
  return page.append(kLink);
}

}  // namespace sightline
