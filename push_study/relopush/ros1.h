// What the planner of ReloPush uses of ROS 1, without ROS 1: messages that hold their values,
// publishers that tell nobody, and a tf that knows no transform. The planner reads none of it back.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Dense>

#define ROS_ERROR(...)
#define ROS_WARN(...)


namespace ros {
struct Duration {
  double seconds;
  Duration(double s = 0.0) : seconds(s) {}
  void sleep() const {}
};
struct Time {
  double seconds;
  Time(double s = 0.0) : seconds(s) {}
  static Time now() { return Time(); }
  Time operator+(const Duration& d) const { return Time(seconds + d.seconds); }
};
struct Publisher {
  template <class M>
  void publish(const M&) const {}
};
struct NodeHandle {
  template <class M>
  Publisher advertise(const std::string&, unsigned) {
    return Publisher();
  }
};
inline void init(int, char**, const std::string&) {}
inline void spinOnce() {}
inline bool ok() { return false; }
namespace topic {
template <class M>
std::shared_ptr<M const> waitForMessage(const std::string&) {
  return nullptr;
}
template <class M>
std::shared_ptr<M const> waitForMessage(const std::string&, NodeHandle&) {
  return nullptr;
}
}  // namespace topic
}  // namespace ros

namespace std_msgs {
struct Header {
  std::string frame_id;
  ros::Time stamp;
};
struct String {
  std::string data;
};
struct Float32 {
  float data = 0.0f;
};
using Float32ConstPtr = std::shared_ptr<Float32 const>;
struct ColorRGBA {
  float r = 0.0f, g = 0.0f, b = 0.0f, a = 0.0f;
};
}  // namespace std_msgs

namespace geometry_msgs {
struct Point {
  double x = 0.0, y = 0.0, z = 0.0;
};
using Vector3 = Point;
struct Quaternion {
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
};
struct Pose {
  Point position;
  Quaternion orientation;
};
struct PoseStamped {
  std_msgs::Header header;
  Pose pose;
};
struct PoseWithCovariance {
  Pose pose;
};
struct PoseWithCovarianceStamped {
  std_msgs::Header header;
  PoseWithCovariance pose;
};
}  // namespace geometry_msgs

namespace nav_msgs {
struct Path {
  std_msgs::Header header;
  std::vector<geometry_msgs::PoseStamped> poses;
};
}  // namespace nav_msgs

namespace visualization_msgs {
struct Marker {
  enum { ARROW = 0, CUBE = 1, SPHERE = 2, CYLINDER = 3, LINE_STRIP = 4, TEXT_VIEW_FACING = 9 };
  enum { ADD = 0 };
  std_msgs::Header header;
  std::string ns, text;
  int id = 0, type = 0, action = 0;
  geometry_msgs::Pose pose;
  geometry_msgs::Vector3 scale;
  std_msgs::ColorRGBA color;
  ros::Duration lifetime;
  std::vector<geometry_msgs::Point> points;
  std::vector<std_msgs::ColorRGBA> colors;
};
struct MarkerArray {
  std::vector<Marker> markers;
};
}  // namespace visualization_msgs

namespace tf {
struct Vector3 {
  double v[3] = {0.0, 0.0, 0.0};
  double getX() const { return v[0]; }
  double getY() const { return v[1]; }
  double getZ() const { return v[2]; }
  double operator[](int i) const { return v[i]; }
};
struct Quaternion {
  double getX() const { return 0.0; }
  double getY() const { return 0.0; }
  double getZ() const { return 0.0; }
  double w() const { return 1.0; }
};
struct Matrix3x3 {
  Matrix3x3(const Quaternion&) {}
  Vector3 operator[](int i) const {
    Vector3 row;
    row.v[i] = 1.0;
    return row;
  }
};
struct Transform {
  static Transform getIdentity() { return Transform(); }
  void setData(const Transform&) {}
  Quaternion getRotation() const { return Quaternion(); }
  Vector3 getOrigin() const { return Vector3(); }
  Transform operator*(const Transform&) const { return *this; }
};
using Pose = Transform;
using StampedTransform = Transform;
struct TransformException : std::exception {};
struct TransformListener {
  bool waitForTransform(const std::string&, const std::string&, ros::Time, ros::Duration) {
    return false;
  }
  void lookupTransform(const std::string&, const std::string&, ros::Time, StampedTransform&) {}
};
inline void poseMsgToTF(const geometry_msgs::Pose&, Pose&) {}
inline void poseTFToMsg(const Pose&, geometry_msgs::Pose&) {}
inline geometry_msgs::Quaternion createQuaternionMsgFromYaw(double) {
  return geometry_msgs::Quaternion();
}
template <class V>
void vectorTFToEigen(const Vector3&, V&) {}
inline void poseMsgToEigen(const geometry_msgs::Pose&, Eigen::Affine3d&) {}
}  // namespace tf
