#include "pipeline/options/option_ranges.h"

#include <limits>
#include <numeric>
#include <type_traits>

#include <nlohmann/json.hpp>

#include "pipeline/options/reconstruction_options.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

// The last value from `good`, which is accepted, towards `bad`, which is not, and the one behind it.
template <typename Field>
struct Edge {
  Field accepted;
  Field refused;
};

template <typename Field, typename IsAccepted>
Edge<Field> FindEdge(Field good, Field bad, const IsAccepted& is_accepted) {
  while (true) {
    const Field middle = std::midpoint(good, bad);  // rounds towards `good` when it has to
    if (middle == good || middle == bad) return {good, bad};
    (is_accepted(middle) ? good : bad) = middle;
  }
}

// Between 0 < x and 0.1 <= x the rounder number tells: one of the two neighbours is what somebody wrote down.
template <typename Field>
void AddBound(const Edge<Field>& edge, const char* inclusive, const char* exclusive, Json& json) {
  const bool refused_is_rounder = Json(edge.refused).dump().size() < Json(edge.accepted).dump().size();
  if (!std::is_integral_v<Field> && refused_is_rounder) {
    json[exclusive] = edge.refused;
  } else {
    json[inclusive] = edge.accepted;
  }
}

// `accepts(value)`: whether the options are good with this value of the field.
template <typename Field, typename Accepts>
void AddRange(Field value, const Accepts& accepts, Json& json) {
  constexpr Field kLeast = std::numeric_limits<Field>::lowest();
  constexpr Field kMost = std::numeric_limits<Field>::max();
  if (!accepts(kLeast)) AddBound(FindEdge(value, kLeast, accepts), "minimum", "exclusiveMinimum", json);
  if (!accepts(kMost)) AddBound(FindEdge(value, kMost, accepts), "maximum", "exclusiveMaximum", json);
}

}  // namespace

std::string DescribeOptionsWithRanges() {
  Json list = Json::array();
  ReconstructionOptions options;
  VisitOptions(options, [&](const char* group, const char* name, auto& field, const char* help) {
    using Field = std::remove_reference_t<decltype(field)>;
    Json json = {{"name", name},
                 {"group", group},
                 {"type", std::is_integral_v<Field> ? "integer" : "number"},
                 {"default", field}};
    const Field value = field;
    const auto accepts = [&](Field tried) {
      field = tried;
      const bool good = options.Validate().ok();
      field = value;
      return good;
    };
    AddRange(value, accepts, json);
    json["documentation"] = help;
    list.push_back(std::move(json));
  });
  Json response;
  response["options"] = std::move(list);
  return response.dump();
}

}  // namespace meshwright
