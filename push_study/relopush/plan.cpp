// An instance of ReloPush from standard input, planned by the program of its authors: the last line is the plan, as JSON.
#define main authors_main
#include "src/reloPush.cpp"
#undef main

#include <ctime>

int main(int argc, char** argv) {
  const std::string mode = argc > 1 ? argv[1] : "";
  if (mode != "proposed" && mode != "dubins_only" && mode != "mp_only") {
    std::cerr << "usage: plan proposed|dubins_only|mp_only < INSTANCE" << std::endl;
    return 2;
  }
  params::use_better_path = mode == "proposed";
  params::use_mp_only = mode == "mp_only";

  ros::NodeHandle node;
  nh_ptr = &node;
  initialize_publishers(node);

  std::vector<movableObject> boxes, goals, delivered;
  std::vector<State> robots;
  strMap assigned = parse_movableObjects_robots_from_file(boxes, robots, goals, 0, "/dev/stdin");
  GraphPtr graph(new Graph);
  graphTools::EdgeMatcher edges;
  std::unordered_set<State> obstacles;
  Environment room(params::map_max_x, params::map_max_y, obstacles, Constants::r_push, Constants::LF_push, false);
  deliveryContextSet deliveries;
  std::unordered_map<std::string, std::vector<std::pair<StatePtr, reloDubinsPath>>> failed;
  for (auto& box : boxes) failed.insert({box.get_name(), {}});
  stopWatchSet watches;

  const std::clock_t began = std::clock();
  reloPlanResult found =
      reloLoop(obstacles, boxes, delivered, room, params::map_max_x, params::map_max_y, graph, edges, watches, goals,
               assigned, deliveries.delivery_contexts, robots, failed);
  const double spent = static_cast<double>(std::clock() - began) / CLOCKS_PER_SEC;

  std::cout << "\n{\"found\": " << (found.is_succ ? "true" : "false") << ", \"cpu_s\": " << spent << ", \"paths\": [";
  const char* next = "";
  State place;
  bool relocated = false;  // then the pose from which the box is pushed on is not in the plan
  for (auto& part : found.pathInfoList.paths) {
    State from = part.fromPose;
    const State& to = part.toPose;
    if (part.type == moveType::final && relocated) from = State(place.x, place.y, from.yaw);
    if (part.type != moveType::app) relocated = part.type == moveType::pre;
    if (part.type == moveType::pre) {
      const float way = std::hypot(to.x - from.x, to.y - from.y) + params::pre_relo_pre_push_offset;
      place = find_post_push(from, params::pre_push_dist + way);
    }
    std::cout << next << "{\"kind\": \"" << moveTypeToStr(part.type) << "\", \"start\": [" << from.x << ", " << from.y
              << ", " << from.yaw << "], \"end\": [" << to.x << ", " << to.y << ", " << to.yaw << "]}";
    next = ", ";
  }
  std::cout << "]}" << std::endl;
  return 0;
}
