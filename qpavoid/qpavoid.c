#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#define STRAIGHT 0.0001
#define ROUND 1.0
#define TINY 1e-09
#define V_X 5
#define V_Y 6
#define X1 0
#define Y1 1
#define X2 2
#define Y2 3
#define TURN 7
#define PIVOT_X 8
#define PIVOT_Y 9
#define RADIUS 4
#define OWNER 10
#define FARTHEST 1e+100
#define NO_LENGTH 1e-12
#define P_X 0
#define P_Y 1
#define DISTANCE 4
#define NORMAL_X 2
#define NORMAL_Y 3
#define OBSTACLE_V_X 5
#define OBSTACLE_V_Y 6
#define OBSTACLE 7
#define SEGMENT 8
#define SPARE 0.02
#define NEARER 0.0001
#define FINE 0.02
#define LANES_FARTHEST 2.0
#define APART 0.1
#define LANE_PITCH 0.001
#define EQUAL 1e-06
#define RELATIVE_ROUNDING 1e-09
#define B 2
#define A_V 0
#define A_OMEGA 1
#define CONFLICT 1e-12
#define N_1 4
#define N_2 5
#define C 6
#define SOFTNESS 7
#define ON_BORDER 1e-06
#define STRIDE 4
#define SECTORS 8
#define CONTACT_WIDTH 9
#define WIDTH 9
#define BODY 18
#define FEW 4
#define ARC 15
#define SIDE 7
#define CAPSULE_WIDTH 11
#define V 0
#define OMEGA 1
#define PENDING 13
#define AGAIN -3
#define R_MIN_TOLERANCE 0.001
#define REPLAY_ROUNDING 1e-08
#define STOPPED 3
#define STUCK 4.0
#define SAME_TIME 1e-06
#define SHARE_V 8
#define SHARE_OMEGA 9
#define MOVES 1.0
#define KIND 14
#define ROW_ROUNDING 1e-09
#define LOOKS 80
#define AFAR 0.1
#define BOUND_ROUNDING 1e-10
#define NO_BEND 1e-300
#define HOLDING 7
#define PLANNED 10
#define RELAXED 2
#define CARRIED 3.0
#define UNTIL 8
#define PLAN_V 2
#define PLAN_OMEGA 3
#define SWITCH 4
#define END 7
#define THEN_V 5
#define THEN_OMEGA 6
#define STATE_SIZE 29
#define GROUP 17
#define BROAD_PHASE_OWNER 15
#define STEP 0.05
#define MOST_STEPS 1000000.0
#define REFINEMENTS 6
#define BRAKING 6
#define ALIKE 0.001
#define NULL_ROW 1e-09
#define VIOLATED 4e-12
#define CHOSEN 8
#define GRANTED 1e-14
#define PARALLEL 1e-13
#define LEAST_SLACK 1e-12
#define ALLOWANCE 1e-13
#define ROUNDS 64
#define LEAST_MORE 1e-09
#define RESIDUAL_TOLERANCE 1e-06
#define UNCHANGED 1e-09
#define BARRIER 0
#define TRACKING 0
#define FILTERED 1
#define STEP_OWNER 3
#define MARK 2
#define LEAD 6
#define STILL 1
#define LOOKED 5
#define BEGUN 15
#define MODE 0
#define DETOUR 2
#define TURNED 0.5
#define WANTS_V 0.02
#define WANTS_OMEGA 0.05
#define CLEAR 0
#define STAGE_CHOSEN 17
#define WAY 22
#define DUE 16
#define TICK 0.1
#define UNLIMITED_TWIST 10.0
#define STANDS 0.0
#define WIDE 0.3
#define MANY 32
#define NO_SQUARE 1e-18
#define SPEED_AT_REST 0.01
#define CREEPS 2.0
#define BODY_TABLE_OWNER 15
#define HOLD 2.0
#define CHOICE_KIND 0
#define A 1
#define LEFT 3
#define TRACK 0.0
#define CHOICE_V 3
#define SLOW 0.05
#define PARK 3.0
#define X 0
#define Y 1
#define LEFT_TO_GO 0.05
#define MOST 2.0
#define LATEST 60
#define STANDING 2
#define FIRST 3
#define FOLLOWS 44
#define FOLLOW 1.0
#define GRAZE 0.005
#define STAY 15
#define HEADING 2
#define ROLLOUT_V 3
#define ROLLOUT_OMEGA 4
#define AT 0.008
#define TURN_IN 4.0
#define SAME_TURNS 1e-09
#define ASIDE 0.5
#define CLOSE 3.0
#define SOONER 10
#define HOLDS 36
#define NOT_CHOSEN -1.0
#define BESIDE 0.5
#define STEERING_V 3
#define CATCH_UP 1.5
#define LOOK 0.5
#define LOOK_TIME 0.4
#define TURN_ON_SPOT 1.2
#define RESTING 0
#define FORWARDS 1
#define BACKWARDS -1
#define RELUCTANCE 1.0
#define AHEAD 1e-06
#define DEEP 0.15
#define LOST 1000.0
#define CHOICE_SIDE 4
#define OTHER 1.5
#define LESS 0.999999
#define KEPT 30.0
#define FAILED 12
#define BACKS 14
#define STAGE_KIND 0
#define SEARCHING 1
#define BACKING 3
#define BACKED 13
#define BACK_TIME 3.0
#define PLACE 9
#define COUNT 11
#define ROOM_FINE 0.05
#define AMPLE 0.5
#define REFERENCE_RESTS 0.001
#define STAGE_AHEAD 0.5
#define CELL 0.1
#define STRAIGHT_WITHIN 1.2
#define SPOT_STEPS 8
#define TRACKED_TICKS 20.0
#define SHARE 10
#define STATE_STEP 0.2
#define STATE_TURN 0.2617993877991494
#define MOST_BACKS 2
#define DEMAND 0.02
#define LOSS 0.02
#define MOST_NODES 20000
#define NODE 5
#define LINK 3
#define HEADINGS 24
#define HEAP_WIDTH 3
#define TIGHT_COST 5.0
#define SAME 1e-05
#define WAY_TURN 0.2617993877991494
#define WAY_CLOSE 0.2
#define ALIGNED 0.39269908169872414
#define LEAVING 0.8
#define WAY_STEP 0.2
#define TURN_COST 0.08
#define NEAR_COST 1.5
#define REVERSE_COST 2.0
#define CHANGE_COST 0.4
#define GREED 2.0
#define LEASH 0.3
#define LEASH_TURN 0.5
#define DONE 0.999999999
#define BLOCKED 4
#define LOOP_UNCHANGED 1e-06
#define GREATEST 1000.0
#define SINGULAR_LEVER 1e-09
#define CORNER 1e-09
#define ONCE_ROUND 7.0
#define MOST_COUNTED 1000000000
#define WORKSPACE_TOO_SMALL -2
#define JOINED 64
#define JOINT 1e-09
#define MOST_PENDING 8
#define READY 100
#define INVALID -1
#define BARRIER_ROWS_OWNER 3
#define FREE 0.0
#define GROUPS 4
#define TARGET_MODE 9
#define HOPELESS 3
#define PATIENT 6
#define ITERATIONS 8
#define GAIN 0.98
#define HALVINGS 2
#define ROW_WITHIN 0.25
#define ROOM_OF 4
#define ROW_ROOM 0.002
#define DIAGONAL 0.41421356237309503
#define SLOPES 10
#define BARELY_TURNED 0.001
#define LINEARISATION_OWNER 3
#define SLACK 0.001
#define UNMOVED 0.001
#define DEAR 4.0
#define PASSING 3.0
#define IN_THE_WAY 10.0
#define TARGET_DUE 10
#define NEW_PLAN 2.0
#define CHEAP 0.001
#define TARGET_GROUP 11
#define TARGET_SHARE 12
#define NOTHING_YET -2000000000.0
#define NO_ROOM -1000000000.0
#define PLENTY 0.01
#define MOST_ROOM 3.0
#define BETTER 0.003
#define SHARES 3
#define SINGULAR 5
#define REPELLED 4
#define FINEST 0.01

typedef struct { double *at; int rows; } vector;

typedef struct { double *at; int rows, columns; } matrix;

static double min2(double a, double b) { return b < a ? b : a; }

static double max2(double a, double b) { return b > a ? b : a; }

static int imin(int a, int b) { return b < a ? b : a; }

static int imax(int a, int b) { return b > a ? b : a; }

static double square(double a) { return a * a; }

static double cube(double a) { return a * (a * a); }

static double fmodulo(double a, double b)
{
    const double r = fmod(a, b);
    return r == 0.0 ? copysign(0.0, b) : (r < 0.0) != (b < 0.0) ? r + b : r;
}

static int modulo(int a, int n)
{
    return a % n != 0 && (a < 0) != (n < 0) ? a % n + n : a % n;
}

static int quotient(int a, int n)
{
    return a % n != 0 && (a < 0) != (n < 0) ? a / n - 1 : a / n;
}

static int whole(double a)
{
    return a >= 1e9 ? 1000000000 : a > -1e9 ? (int)a : -1000000000;
}

static vector part(vector a, int from, int to)
{
    vector r = {a.at + from, to - from};
    return r;
}

static vector row_of(matrix a, int i)
{
    vector r = {a.at + i * a.columns, a.columns};
    return r;
}

static matrix band(matrix a, int from, int to)
{
    matrix r = {a.at + from * a.columns, to - from, a.columns};
    return r;
}

static matrix shaped(vector a, int rows, int columns)
{
    matrix r = {a.at, rows, columns};
    return r;
}

typedef const struct {
    double r_min_slow;
    double r_min_fast;
    double speed_low;
    double speed_high;
    double zone_ratio;
    double closing_gain;
    double speed;
    int64_t activation;
    double damping;
    double horizon;
    double horizon_still;
    double tick;
    double hysteresis;
    double review;
    double closest;
    double delay;
    double jitter;
    int64_t ramps;
    int64_t bound;
    double gamma;
    double reach;
    double slack_tolerance;
    double dt;
    int64_t braking_room;
    int64_t passive;
    double error;
    double obstacle_acceleration;
    double weight_v;
    double weight_omega;
} *filter_settings;

typedef const struct {
    double r_min_slow;
    double r_min_fast;
    double speed_low;
    double speed_high;
    double zone_ratio;
    double closing_gain;
    double stall_time;
    double progress;
    double blocked_time;
    double tolerance;
    double speed;
    double turn_rate;
    double clearance;
    double reach;
    double interval;
    double horizon;
    double soft;
    double near;
    double deep;
    double enter;
    double heading;
    double hysteresis;
    double preference;
    double clear;
    double back_speed;
    double inner;
} *guide_settings;

typedef struct {
    double clearance;
    double room;
    double deviation;
    double changed;
    double relaxed;
    double blocked;
    double arrived;
    double error;
    double heading_error;
    double still;
    double time;
    double start;
    double struck;
    double jerk;
    double length;
} *loop_outcome;

typedef struct { double _0; double _1; double _2; } tuple_ddd;

typedef struct { double _0; double _1; } tuple_dd;

/* qpavoid.types: Twists between limits, possibly infinite. */
typedef struct {
    double v_min;
    double v_max;
    double omega_min;
    double omega_max;
} Box;

/* qpavoid.avoidance.prediction: A twist, from ``switch`` on another, from ``end`` on
 * braking along the arc. */
typedef struct {
    double v;
    double omega;
    double switch_;
    double v_then;
    double omega_then;
    double end;
} Plan;

/* qpavoid.avoidance.target: What is aimed at. */
typedef struct {
    Plan plan;
    double mode;
    double room;
    int owner;
} Target;

/* qpavoid.avoidance.ladder: State of a control step before its QP is solved. */
typedef struct {
    int code;
    double clearance;
    int most;
    int bodies;
    int m;
    int n_hard;
    tuple_dd last;
    Box box;
    tuple_dd wish;
    tuple_dd desired;
    tuple_dd rest;
    tuple_dd anchor;
    Target target;
    bool ahead;
} Prepared;

typedef struct { matrix _0; matrix _1; } tuple_mm;

/* qpavoid.avoidance.lanes: What is driven, among what. */
typedef struct {
    matrix edges;
    tuple_mm obstacles;
    tuple_mm seen;
    matrix contacts;
    double radius;
    double keep;
    double v;
    double turn;
    double reverse;
    double ahead;
} LaneSearch;

/* qpavoid.avoidance.lanes: A way into a lane. */
typedef struct {
    double aside;
    double angle;
    double far;
    double back;
} Lane;

typedef struct { int _0; int _1; } tuple_ii;

/* qpavoid.model.capsules: A piece of a line: a wall, or the axis of a capsule. */
typedef struct {
    double x1;
    double y1;
    double x2;
    double y2;
} Segment;

/* qpavoid.model.contact: A row of the edges of a footprint; see :class:`Footprint`. */
typedef struct {
    double x;
    double y;
    double n_x;
    double n_y;
    double length;
} Edge;

/* qpavoid.model.contact: The nearest footprint point P_r, and the way from there to an
 * obstacle. */
typedef struct {
    double x;
    double y;
    double n_x;
    double n_y;
    double distance;
    int segment;
} Contact;

/* qpavoid.model.contacts: A row of the table: a contact with an obstacle. */
typedef struct {
    double x;
    double y;
    double n_x;
    double n_y;
    double distance;
    double v_x;
    double v_y;
    int obstacle;
    int segment;
} ObstacleContact;

typedef struct { double _0; int _1; } tuple_di;

typedef struct { int _0; int _1; int _2; } tuple_iii;

/* qpavoid.model.robot: :class:`Limits` as the compiled functions take them, and the
 * circumradius, m. */
typedef struct {
    double v_min;
    double v_max;
    double omega_min;
    double omega_max;
    double acceleration;
    double angular_acceleration;
    double wheel_speed;
    double track;
    double circumradius;
} RobotLimits;

/* qpavoid.qp.exact: What a problem consists of beside its rows. */
typedef struct {
    Box box;
    tuple_dd desired;
    tuple_dd weights;
    int n_hard;
} Terms;

/* qpavoid.avoidance.scene: Robot and settings, constant over a run. */
typedef struct {
    matrix edges;
    vector robot;
    filter_settings settings;
} Setup;

/* qpavoid.avoidance.linearisation: Memory of the look-ahead. */
typedef struct {
    matrix sides;
    matrix rows;
    matrix frames;
} Tables;

/* qpavoid.avoidance.workspace: Memory of a control step, carved out of one array. */
typedef struct {
    matrix contacts;
    matrix rows;
    matrix bodies;
    matrix groups;
    matrix arcs;
    Tables tables;
    matrix points;
    matrix capsules;
} Workspace;

/* qpavoid.avoidance.scene: Context of all predictions of a control step. */
typedef struct {
    matrix edges;
    vector robot;
    filter_settings settings;
    matrix bodies;
    tuple_dd last;
    tuple_dd pending;
    matrix arcs;
    matrix groups;
    double longest;
    double drift;
    double closest;
} Scene;

/* qpavoid.avoidance.ladder: Result of a control step. */
typedef struct {
    int code;
    double v;
    double omega;
    double clearance;
    double slack;
    double residual;
    double shortfall;
    int first;
    int second;
} Outcome;

/* qpavoid.model.kinematics: A pose whose heading is known by its cosine and sine. */
typedef struct {
    double x;
    double y;
    double cos;
    double sin;
} Frame;

/* qpavoid.avoidance.prediction: A part of a rollout: the twist is held, or braked to
 * rest along its arc. */
typedef struct {
    double begin;
    double x;
    double y;
    double cos;
    double sin;
    double v;
    double omega;
    double steps;
    double share_v;
    double share_omega;
} Arc;

/* qpavoid.avoidance.prediction: Trajectory of a plan: arcs with zero-order hold. */
typedef struct {
    matrix arcs;
    double speed;
    double turning;
    double rest;
    tuple_dd target;
} Rollout;

/* qpavoid.avoidance.body_table: A moving segment, and the distance to keep from it:
 * r_min and the inflation. */
typedef struct {
    double x;
    double y;
    double x1;
    double y1;
    double x2;
    double y2;
    double v_x;
    double v_y;
    double turn;
    double keep;
    double inflation;
    double spread;
    double speed;
    double growth;
    double kind;
    double owner;
    double now;
    double group;
} Body;

/* qpavoid.avoidance.motion: One end of a body's line, from the robot. */
typedef struct {
    double x;
    double y;
    double v_x;
    double v_y;
} End;

/* qpavoid.avoidance.motion: Both ends of a body's line at a time; of a point they are
 * the same. */
typedef struct {
    End one;
    End other;
} Ends;

typedef struct { bool _0; double _1; } tuple_bd;

/* qpavoid.avoidance.time_bounds: What an arc drives at a time. */
typedef struct {
    double v;
    double omega;
    bool brakes;
} ArcTwist;

/* qpavoid.avoidance.ladder: A fallback: what is driven instead of the answer of the QP.
 * */
typedef struct {
    int code;
    tuple_dd twist;
    Plan plan;
    double room;
    double until;
    double residual;
} Choice;

/* qpavoid.avoidance.broad_phase: What is looked at along a rollout. */
typedef struct {
    tuple_dd moving;
    tuple_dd still;
} Watch;

/* qpavoid.qp.exact: The point that all half-planes share nearest to another. */
typedef struct {
    bool found;
    double z_1;
    double z_2;
    int first;
    int second;
    double wanted;
} Projection;

/* qpavoid.qp.exact: The answer of a problem. */
typedef struct {
    bool found;
    double v;
    double omega;
    double slack;
    int first;
    int second;
} Optimum;

/* qpavoid.guide.stage: What stays the same from step to step. */
typedef struct {
    Setup setup;
    vector law;
    guide_settings settings;
    matrix body;
} Stage;

/* qpavoid.guide.stage: Memory of a step. */
typedef struct {
    matrix bodies;
    vector search;
} StageMemory;

/* qpavoid.guide.stage: Input of a step: what tracking asks for, and what has been
 * driven. */
typedef struct {
    tuple_dd desired;
    tuple_ddd error;
    double v_r;
    tuple_dd driven;
    double dt;
    matrix ahead;
} Tracking;

/* qpavoid.avoidance.settings: r_min over the speed of an obstacle: what compiled
 * functions know of it. */
typedef struct {
    double r_min_slow;
    double r_min_fast;
    double speed_low;
    double speed_high;
} RadiusCurve;

/* qpavoid.guide.rollout: What all rollouts of a step share. */
typedef struct {
    Scene scene;
    matrix ahead;
    vector law;
    guide_settings settings;
} Course;

/* qpavoid.guide.rollout: What to do for the next seconds. */
typedef struct {
    double kind;
    double a;
    double b;
    double held;
} Candidate;

/* qpavoid.tracking.kanayama: Where the robot is to be. */
typedef struct {
    double x;
    double y;
    double heading;
    double v;
    double omega;
} Reference;

/* qpavoid.tracking.station: Gains of Eq. 6, and settings of the law at rest. */
typedef struct {
    tuple_ddd moving;
    tuple_ddd resting;
    double rest;
    double wake;
    double blend_speed;
} TrackingLaw;

typedef struct { double _0; double _1; int _2; } tuple_ddi;

typedef struct { int _0; double _1; double _2; } tuple_idd;

/* qpavoid.guide.room: Distance field about the robot, and the points of its footprint.
 * */
typedef struct {
    matrix nodes;
    double half;
    matrix body;
} Field;

typedef struct { bool _0; double _1; double _2; } tuple_bdd;

/* qpavoid.guide.way: Problem of a search. */
typedef struct {
    double inner;
    bool reverse;
    double clearance;
    double loss;
    tuple_ddd target;
    bool turned;
    matrix walls;
} Search;

/* qpavoid.guide.way: Search tree of hybrid A*, and its memory. */
typedef struct {
    matrix nodes;
    matrix links;
    matrix best;
    matrix remaining;
    matrix heap;
} Tree;

/* qpavoid.guide.geodesic: Where distances are measured to. */
typedef struct {
    double x;
    double y;
    matrix walls;
} Goal;

/* qpavoid.guide.heap: What waits, in the order of its fields. */
typedef struct {
    double cost;
    int i;
    int j;
} Item;

/* qpavoid.model.capsules: What all capsules of an obstacle have in common. */
typedef struct {
    double radius;
    double v_x;
    double v_y;
    double turn;
    tuple_dd pivot;
    int owner;
} Rigid;

/* qpavoid.avoidance.scene: Input of a control step. */
typedef struct {
    tuple_mm obstacles;
    double age;
    bool ahead;
    tuple_dd desired;
} Request;

/* qpavoid.avoidance.lookahead: Problem of the look-ahead. */
typedef struct {
    Box box;
    tuple_dd desired;
    int many;
    Tables tables;
} Query;

/* qpavoid.avoidance.broad_phase: First violation along a rollout. */
typedef struct {
    int body;
    double time;
} Meeting;

/* qpavoid.avoidance.lookahead: A constant twist. */
typedef struct {
    double v;
    double omega;
    double cost;
} Candidate2;

/* qpavoid.avoidance.linearisation: A contact at a time to come that gets a row. */
typedef struct {
    double x;
    double y;
    double n_x;
    double n_y;
    double room;
    double time;
    double body;
} Side;

/* qpavoid.avoidance.prediction: Derivatives of a pose of a rollout by the first target.
 * */
typedef struct {
    double x_v;
    double y_v;
    double x_omega;
    double y_omega;
    double turn;
} Slopes;

/* qpavoid.avoidance.plans: A plan with its evaluation. */
typedef struct {
    Plan plan;
    double room;
    double cost;
    int body;
    double time;
} Found;

typedef struct { int _0; double _1; double _2; double _3; double _4; double _5; double _6; int _7; int _8; } tuple_iddddddii;

/* qpavoid.lab.simulation.outcome: What counts as arrival. */
typedef struct {
    tuple_ddd pose;
    double near;
    double aligned;
} Goal2;

/* qpavoid.lab.simulation.clearance: A robot under way, world frame. */
typedef struct {
    tuple_ddd pose;
    tuple_dd twist;
    double lateral;
    double time;
    double pace;
} Motion;

/* qpavoid.lab.simulation.clearance: Obstacles, and memory for them in the robot frame.
 * */
typedef struct {
    tuple_mm world;
    tuple_mm seen;
    matrix contacts;
} View;

typedef struct { Reference _0; double _1; } tuple_Reference_d;

/* qpavoid.avoidance.settings: Return the share of ẋ_0 that acts at a distance, from 0
 * (d ≥ r) to 1 (d ≤ r_min). */
static double activation(int kind, double distance, double r_min, double r)
{
    if (distance >= r) {
        return 0.0;
    }
    if (kind == 0 || distance <= r_min) {
        return 1.0;
    }
    const double share = (r - distance) / (r - r_min);
    return kind == 1 ? share : share * share * (3.0 - 2.0 * share);
}

/* qpavoid.model.kinematics: Return the pose after driving a constant twist for ``dt``:
 * Eq. 1 integrated. */
static tuple_ddd arc(double x, double y, double heading, double v, double omega, double
    dt)
{
    double sinc = 0;
    const double half = 0.5 * omega * dt;
    if (fabs(half) < STRAIGHT) {
        sinc = 1.0 - half * half / 6.0;
    } else {
        sinc = sin(half) / half;
    }
    const double chord = v * dt * sinc;
    return (tuple_ddd){x + chord * cos(heading + half), y + chord * sin(heading + half),
        heading + omega * dt};
}

/* qpavoid.avoidance.step: Return how often the QP is solved at most: not where no
 * single twist will do. */
static int attempts(const Prepared *restrict prepared)
{
    return prepared->target.mode <= ROUND ? 3 : 0;
}

/* qpavoid.model.capsules: Return the axis of capsule i as it is now. */
static Segment axis_of(matrix capsules, int i)
{
    const vector c = row_of(capsules, i);
    return (Segment){c.at[X1], c.at[Y1], c.at[X2], c.at[Y2]};
}

/* qpavoid.model.capsules: Return the axis of capsule i after ``time`` s of its motion.
 * */
static Segment capsule_at(matrix capsules, int i, double time)
{
    const double on_x = time * capsules.at[i * capsules.columns + V_X];
    const double on_y = time * capsules.at[i * capsules.columns + V_Y];
    const Segment axis_of_1 = axis_of(capsules, i);
    double x1 = axis_of_1.x1;
    double y1 = axis_of_1.y1;
    double x2 = axis_of_1.x2;
    double y2 = axis_of_1.y2;
    if (capsules.at[i * capsules.columns + TURN] != 0.0) {
        const double angle = capsules.at[i * capsules.columns + TURN] * time;
        const double cos_ = cos(angle);
        const double sin_ = sin(angle);
        const double c_x = capsules.at[i * capsules.columns + PIVOT_X];
        const double c_y = capsules.at[i * capsules.columns + PIVOT_Y];
        const double d_x = x1 - c_x;
        const double d_y = y1 - c_y;
        const double e_x = x2 - c_x;
        const double e_y = y2 - c_y;
        x1 = c_x + (cos_ * d_x - sin_ * d_y);
        y1 = c_y + (sin_ * d_x + cos_ * d_y);
        x2 = c_x + (cos_ * e_x - sin_ * e_y);
        y2 = c_y + (sin_ * e_x + cos_ * e_y);
    }
    return (Segment){x1 + on_x, y1 + on_y, x2 + on_x, y2 + on_y};
}

/* qpavoid.model.capsules: Fill ``seen``: obstacles of the world in the frame of a robot
 * at a pose. */
static void in_robot_frame(const tuple_ddd *restrict pose, double time, const tuple_mm
    *restrict world, const tuple_mm *restrict seen)
{
    double d_x = 0;
    double d_y = 0;
    const double x = pose->_0;
    const double y = pose->_1;
    const double heading = pose->_2;
    const matrix points = world->_0;
    const matrix capsules = world->_1;
    const double cos_ = cos(heading);
    const double sin_ = sin(heading);
    const int end_2 = points.rows;
    for (int i = 0; i < end_2; i++) {
        d_x = points.at[i * points.columns + 0] - x;
        d_y = points.at[i * points.columns + 1] - y;
        seen->_0.at[i * seen->_0.columns + 0] = cos_ * d_x + sin_ * d_y;
        seen->_0.at[i * seen->_0.columns + 1] = cos_ * d_y - sin_ * d_x;
    }
    const matrix here = seen->_1;
    const int end_4 = capsules.rows;
    for (int i = 0; i < end_4; i++) {
        const double v_x = capsules.at[i * capsules.columns + V_X];
        const double v_y = capsules.at[i * capsules.columns + V_Y];
        const Segment capsule_at_5 = capsule_at(capsules, i, time);
        const double x1 = capsule_at_5.x1;
        const double y1 = capsule_at_5.y1;
        const double x2 = capsule_at_5.x2;
        const double y2 = capsule_at_5.y2;
        d_x = x1 - x;
        d_y = y1 - y;
        here.at[i * here.columns + X1] = cos_ * d_x + sin_ * d_y;
        here.at[i * here.columns + Y1] = cos_ * d_y - sin_ * d_x;
        d_x = x2 - x;
        d_y = y2 - y;
        here.at[i * here.columns + X2] = cos_ * d_x + sin_ * d_y;
        here.at[i * here.columns + Y2] = cos_ * d_y - sin_ * d_x;
        const double new_6 = capsules.at[i * capsules.columns + TURN];
        here.at[i * here.columns + RADIUS] = capsules.at[i * capsules.columns + RADIUS];
        here.at[i * here.columns + TURN] = new_6;
        here.at[i * here.columns + V_X] = cos_ * v_x + sin_ * v_y;
        here.at[i * here.columns + V_Y] = cos_ * v_y - sin_ * v_x;
        d_x = capsules.at[i * capsules.columns + PIVOT_X] + time * v_x - x;
        d_y = capsules.at[i * capsules.columns + PIVOT_Y] + time * v_y - y;
        here.at[i * here.columns + PIVOT_X] = cos_ * d_x + sin_ * d_y;
        here.at[i * here.columns + PIVOT_Y] = cos_ * d_y - sin_ * d_x;
        here.at[i * here.columns + OWNER] = capsules.at[i * capsules.columns + OWNER];
    }
}

/* qpavoid.model.contact: Return an edge of the footprint. */
static Edge edge_at(matrix edges_, int row)
{
    const double x = edges_.at[row * edges_.columns + 0];
    const double y = edges_.at[row * edges_.columns + 1];
    const double n_x = edges_.at[row * edges_.columns + 2];
    const double n_y = edges_.at[row * edges_.columns + 3];
    return (Edge){x, y, n_x, n_y, edges_.at[row * edges_.columns + 4]};
}

/* qpavoid.model.contact: Return a corner of the footprint, m: where the edge of its
 * number starts. */
static tuple_dd corner_at(matrix edges_, int corner)
{
    const Edge edge = edge_at(edges_, corner);
    return (tuple_dd){edge.x, edge.y};
}

/* qpavoid.model.contact: Return the contact of a convex footprint with the point (x,
 * y). */
static Contact point_contact(matrix edges_, double x, double y)
{
    Edge edge = {0};
    double p_x = 0;
    double p_y = 0;
    double greatest = -INFINITY;
    int segment = 0;
    const int end_2 = edges_.rows;
    for (int i = 0; i < end_2; i++) {
        edge = edge_at(edges_, i);
        const double s = edge.n_x * (x - edge.x) + edge.n_y * (y - edge.y);
        if (s > greatest) {
            greatest = s;
            segment = i;
        }
    }
    edge = edge_at(edges_, segment);
    double n_x = edge.n_x;
    double n_y = edge.n_y;
    const double along = n_x * (y - edge.y) - n_y * (x - edge.x);
    if (greatest > 0.0 && !(0.0 <= along && along <= edge.length)) {
        int corner = along < 0.0 ? segment : segment + 1;
        if (corner == edges_.rows) {
            corner = 0;
        }
        const tuple_dd corner_at_3 = corner_at(edges_, corner);
        p_x = corner_at_3._0;
        p_y = corner_at_3._1;
        const double d_x = x - p_x;
        const double d_y = y - p_y;
        const double distance = sqrt(d_x * d_x + d_y * d_y);
        if (distance > NO_LENGTH) {
            n_x = d_x / distance;
            n_y = d_y / distance;
        }
        return (Contact){p_x, p_y, n_x, n_y, distance, segment};
    }
    p_x = x - greatest * n_x;
    p_y = y - greatest * n_y;
    return (Contact){p_x, p_y, n_x, n_y, greatest, segment};
}

/* qpavoid.model.contacts: Write a row of the table. */
static void set_contact(matrix contacts, int row, const ObstacleContact *restrict
    contact)
{
    const vector c = row_of(contacts, row);
    c.at[P_X] = contact->x;
    c.at[P_Y] = contact->y;
    c.at[DISTANCE] = contact->distance;
    c.at[NORMAL_X] = contact->n_x;
    c.at[NORMAL_Y] = contact->n_y;
    c.at[OBSTACLE_V_X] = contact->v_x;
    c.at[OBSTACLE_V_Y] = contact->v_y;
    c.at[OBSTACLE] = contact->obstacle;
    c.at[SEGMENT] = contact->segment;
}

/* qpavoid.model.contacts: Fill in those of the points; ``within``: circumradius and
 * reach, m. */
static tuple_ii point_contacts(matrix edges_, matrix points, tuple_dd within, matrix
    contacts)
{
    int count = 0;
    int nearest = -1;
    double least = INFINITY;
    double beyond = INFINITY;
    const int end_2 = points.rows;
    for (int i = 0; i < end_2; i++) {
        const double x = points.at[i * points.columns + 0];
        const double y = points.at[i * points.columns + 1];
        if (!(fabs(x) < FARTHEST && fabs(y) < FARTHEST)) {
            return (tuple_ii){0, -2};
        }
        if (x * x + y * y > beyond) {
            continue;
        }
        const Contact contact = point_contact(edges_, x, y);
        if (contact.distance < least) {
            nearest = count;
            least = contact.distance;
            beyond = square(within._0 + max2(within._1, least));
        } else if (contact.distance > within._1) {
            continue;
        }
        const double p_x = contact.x;
        const double p_y = contact.y;
        const double n_x = contact.n_x;
        const double n_y = contact.n_y;
        const double distance = contact.distance;
        const int segment = contact.segment;
        const double z = 0.0;
        const ObstacleContact row = (ObstacleContact){p_x, p_y, n_x, n_y, distance, z,
            z, i, segment};
        set_contact(contacts, count, &row);
        count = count + 1;
    }
    return (tuple_ii){count, nearest};
}

/* qpavoid.model.contacts: Return the distance in the row of the nearest contact, m; ∞
 * where it is −1. */
static double nearest_distance(matrix contacts, int nearest)
{
    const double distance = nearest >= 0 ? contacts.at[nearest * contacts.columns +
        DISTANCE] : INFINITY;
    return distance;
}

/* qpavoid.model.capsules: Return the first row after i that belongs to another
 * obstacle. */
static int chain_end(matrix capsules, int i)
{
    int end = i + 1;
    while (end < capsules.rows && capsules.at[end * capsules.columns + OWNER] ==
        capsules.at[i * capsules.columns + OWNER]) {
        end = end + 1;
    }
    return end;
}

/* qpavoid.model.contacts: Return 1 if an obstacle is farther than ``within`` m from the
 * footprint, else 0. */
static int passed_over(matrix chain, double circumradius, double within)
{
    const double x = chain.at[PIVOT_X];
    const double y = chain.at[PIVOT_Y];
    double square_ = 0.0;
    const int end_2 = chain.rows;
    for (int i = 0; i < end_2; i++) {
        const Segment axis_of_3 = axis_of(chain, i);
        const double x1 = axis_of_3.x1;
        const double y1 = axis_of_3.y1;
        const double x2 = axis_of_3.x2;
        const double y2 = axis_of_3.y2;
        double size = fabs(x1) + fabs(y1) + fabs(x2) + fabs(y2) + fabs(x) + fabs(y);
        size = size + (fabs(chain.at[i * chain.columns + V_X]) + fabs(chain.at[i *
            chain.columns + V_Y]) + fabs(chain.at[i * chain.columns + TURN]));
        if (!(size + chain.at[i * chain.columns + RADIUS] < FARTHEST && chain.at[i *
            chain.columns + RADIUS] >= 0.0)) {
            return -1;
        }
        square_ = max2(square_, square(x1 - x) + square(y1 - y));
        square_ = max2(square_, square(x2 - x) + square(y2 - y));
    }
    const double radius = chain.at[RADIUS] + sqrt(square_);
    return x * x + y * y > square(circumradius + radius + within);
}

/* qpavoid.model.capsules: Return whether a capsule is more than a disc. */
static bool has_length(matrix capsules, int i)
{
    if (capsules.at[i * capsules.columns + X1] != capsules.at[i * capsules.columns + X2]
        || capsules.at[i * capsules.columns + Y1] != capsules.at[i * capsules.columns +
        Y2]) {
        return true;
    }
    return false;
}

/* qpavoid.model.contact: Return how far before a line through a place the footprint
 * ends, m; its corner. */
static tuple_di side_separation(matrix edges_, tuple_dd normal, tuple_dd place)
{
    const double n_x = normal._0;
    const double n_y = normal._1;
    const double x = place._0;
    const double y = place._1;
    double least = INFINITY;
    int corner = 0;
    const int end_2 = edges_.rows;
    for (int i = 0; i < end_2; i++) {
        const tuple_dd corner_at_3 = corner_at(edges_, i);
        const double a_x = corner_at_3._0;
        const double a_y = corner_at_3._1;
        const double s = n_x * (x - a_x) + n_y * (y - a_y);
        if (s < least) {
            least = s;
            corner = i;
        }
    }
    return (tuple_di){least, corner};
}

/* qpavoid.model.contact: Return which of the two edges at a corner faces the direction
 * (n_x, n_y) more. */
static int facing_segment(matrix edges_, int corner, double n_x, double n_y)
{
    const int other = modulo(corner - 1, edges_.rows);
    const Edge after = edge_at(edges_, corner);
    const Edge before = edge_at(edges_, other);
    const double facing = n_x * after.n_x + n_y * after.n_y;
    const double facing_before = n_x * before.n_x + n_y * before.n_y;
    return facing >= facing_before ? corner : other;
}

/* qpavoid.model.contact: Return the contact in the direction in which footprint and
 * polygon part soonest. */
static Contact polygon_separation(matrix edges_, matrix chain)
{
    double least = 0;
    double n_x = 0;
    double n_y = 0;
    double p_x = 0;
    double p_y = 0;
    double greatest = -INFINITY;
    Contact contact = (Contact){0.0, 0.0, 1.0, 0.0, INFINITY, -1};
    const int end_2 = edges_.rows;
    for (int i = 0; i < end_2; i++) {
        const Edge edge_at_3 = edge_at(edges_, i);
        const double a_x = edge_at_3.x;
        const double a_y = edge_at_3.y;
        n_x = edge_at_3.n_x;
        n_y = edge_at_3.n_y;
        const double edge_length = edge_at_3.length;
        least = INFINITY;
        double x = 0.0;
        double y = 0.0;
        const int end_5 = chain.rows;
        for (int j = 0; j < end_5; j++) {
            const double s = n_x * (chain.at[j * chain.columns + X1] - a_x) + n_y *
                (chain.at[j * chain.columns + Y1] - a_y);
            if (s < least) {
                least = s;
                x = chain.at[j * chain.columns + X1];
                y = chain.at[j * chain.columns + Y1];
            }
        }
        if (least > greatest) {
            double along = n_x * (y - a_y) - n_y * (x - a_x);
            along = min2(max2(along, 0.0), edge_length);
            greatest = least;
            p_x = a_x - along * n_y;
            p_y = a_y + along * n_x;
            contact = (Contact){p_x, p_y, n_x, n_y, least, i};
        }
    }
    const int end_7 = chain.rows;
    for (int j = 0; j < end_7; j++) {
        const Segment axis_of_8 = axis_of(chain, j);
        const double x1 = axis_of_8.x1;
        const double y1 = axis_of_8.y1;
        const double x2 = axis_of_8.x2;
        const double y2 = axis_of_8.y2;
        const double length = sqrt(square(x2 - x1) + square(y2 - y1));
        n_x = -(y2 - y1) / length;
        n_y = (x2 - x1) / length;
        const tuple_di side_separation_9 = side_separation(edges_, (tuple_dd){n_x, n_y},
            (tuple_dd){x1, y1});
        least = side_separation_9._0;
        const int corner = side_separation_9._1;
        if (least > greatest) {
            greatest = least;
            const int segment = facing_segment(edges_, corner, n_x, n_y);
            const tuple_dd corner_at_10 = corner_at(edges_, corner);
            p_x = corner_at_10._0;
            p_y = corner_at_10._1;
            contact = (Contact){p_x, p_y, n_x, n_y, least, segment};
        }
    }
    return contact;
}

/* qpavoid.model.contact: Return the contact along the direction in which footprint and
 * wall part soonest. */
static Contact wall_separation(matrix edges_, const Segment *restrict wall)
{
    double n_x = 0;
    double n_y = 0;
    double p_x = 0;
    double p_y = 0;
    double greatest = -INFINITY;
    Contact contact = (Contact){0.0, 0.0, 1.0, 0.0, INFINITY, -1};
    const double x1 = wall->x1;
    const double y1 = wall->y1;
    const double x2 = wall->x2;
    const double y2 = wall->y2;
    const int end_2 = edges_.rows;
    for (int i = 0; i < end_2; i++) {
        const Edge edge_at_3 = edge_at(edges_, i);
        const double a_x = edge_at_3.x;
        const double a_y = edge_at_3.y;
        n_x = edge_at_3.n_x;
        n_y = edge_at_3.n_y;
        const double edge_length = edge_at_3.length;
        const double s_1 = n_x * (x1 - a_x) + n_y * (y1 - a_y);
        const double s_2 = n_x * (x2 - a_x) + n_y * (y2 - a_y);
        const tuple_ddd one_4 = s_1 <= s_2 ? (tuple_ddd){s_1, x1, y1} : (tuple_ddd){s_2,
            x2, y2};
        const double s = one_4._0;
        const double x = one_4._1;
        const double y = one_4._2;
        if (s > greatest) {
            double along = n_x * (y - a_y) - n_y * (x - a_x);
            along = min2(max2(along, 0.0), edge_length);
            greatest = s;
            p_x = a_x - along * n_y;
            p_y = a_y + along * n_x;
            contact = (Contact){p_x, p_y, n_x, n_y, s, i};
        }
    }
    const double length = sqrt(square(x2 - x1) + square(y2 - y1));
    if (length < NO_LENGTH) {
        return contact;
    }
    const double among_6[] = {-1.0, 1.0};
    for (int turn_5 = 0; turn_5 < 2; turn_5++) {
        const double side = among_6[turn_5];
        n_x = -side * (y2 - y1) / length;
        n_y = side * (x2 - x1) / length;
        const tuple_di side_separation_7 = side_separation(edges_, (tuple_dd){n_x, n_y},
            (tuple_dd){x1, y1});
        const double least = side_separation_7._0;
        const int corner = side_separation_7._1;
        if (least > greatest) {
            greatest = least;
            const int segment = facing_segment(edges_, corner, n_x, n_y);
            const tuple_dd corner_at_8 = corner_at(edges_, corner);
            p_x = corner_at_8._0;
            p_y = corner_at_8._1;
            contact = (Contact){p_x, p_y, n_x, n_y, least, segment};
        }
    }
    return contact;
}

/* qpavoid.model.contact: Return the contact that says whether an obstacle with a length
 * is cut, or holds. */
static Contact separation(matrix edges_, matrix chain)
{
    if (chain.rows > 1) {
        return polygon_separation(edges_, chain);
    }
    return wall_separation(edges_, (const Segment[]){axis_of(chain, 0)});
}

/* qpavoid.model.contact: Return how many contacts an obstacle with a length can have.
 * */
static int feature_count(matrix edges_, matrix chain)
{
    const int corners = edges_.rows;
    const int sides = chain.rows;
    return sides > 1 ? sides * (1 + corners) : 2 + corners;
}

/* qpavoid.model.contact: Return the contact of one footprint corner with the inside of
 * a wall. */
static Contact corner_contact(matrix edges_, int corner, const Segment *restrict wall)
{
    const double x1 = wall->x1;
    const double y1 = wall->y1;
    const double x2 = wall->x2;
    const double y2 = wall->y2;
    const double length = sqrt(square(x2 - x1) + square(y2 - y1));
    if (length < NO_LENGTH) {
        return (Contact){0.0, 0.0, 1.0, 0.0, INFINITY, -1};
    }
    const double t_x = (x2 - x1) / length;
    const double t_y = (y2 - y1) / length;
    const tuple_dd corner_at_1 = corner_at(edges_, corner);
    const double p_x = corner_at_1._0;
    const double p_y = corner_at_1._1;
    if (!(0.0 < t_x * (p_x - x1) + t_y * (p_y - y1) && t_x * (p_x - x1) + t_y * (p_y -
        y1) < length)) {
        return (Contact){0.0, 0.0, 1.0, 0.0, INFINITY, -1};
    }
    const double distance = t_x * (y1 - p_y) - t_y * (x1 - p_x);
    const double side = distance >= 0.0 ? 1.0 : -1.0;
    const double n_x = -side * t_y;
    const double n_y = side * t_x;
    const int segment = facing_segment(edges_, corner, n_x, n_y);
    return (Contact){p_x, p_y, n_x, n_y, side * distance, segment};
}

/* qpavoid.model.contact: Return one of these contacts; of a capsule that of its axis.
 * */
static Contact feature_contact(matrix edges_, matrix chain, int feature)
{
    int row = 0;
    int part_ = feature;
    int ends = 2;
    if (chain.rows > 1) {
        const int each = 1 + edges_.rows;
        ends = 1;
        row = quotient(feature, each);
        part_ = modulo(feature, each);
    }
    const Segment axis = axis_of(chain, row);
    if (part_ == 0) {
        return point_contact(edges_, axis.x1, axis.y1);
    }
    if (part_ < ends) {
        return point_contact(edges_, axis.x2, axis.y2);
    }
    const Contact contact = corner_contact(edges_, part_ - ends, &axis);
    const bool behind = (axis.x2 - axis.x1) * contact.n_y < (axis.y2 - axis.y1) *
        contact.n_x;
    if (ends == 1 && contact.segment >= 0 && behind) {
        return (Contact){0.0, 0.0, 1.0, 0.0, INFINITY, -1};
    }
    return contact;
}

/* qpavoid.model.capsules: Return the velocity of the point (x, y) of capsule i: v +
 * turn ẑ × lever, m/s. */
static tuple_dd velocity_at(matrix capsules, int i, double x, double y)
{
    double v_x = capsules.at[i * capsules.columns + V_X];
    double v_y = capsules.at[i * capsules.columns + V_Y];
    const double turn = capsules.at[i * capsules.columns + TURN];
    if (turn != 0.0) {
        v_x = v_x - turn * (y - capsules.at[i * capsules.columns + PIVOT_Y]);
        v_y = v_y + turn * (x - capsules.at[i * capsules.columns + PIVOT_X]);
    }
    return (tuple_dd){v_x, v_y};
}

/* qpavoid.model.contacts: Return the contact with an axis as that with its capsule, v_o
 * nearest to P_r. */
static ObstacleContact capsule_contact(const Contact *restrict contact, matrix chain)
{
    const double p_x = contact->x;
    const double p_y = contact->y;
    const double n_x = contact->n_x;
    const double n_y = contact->n_y;
    double distance = contact->distance;
    const int segment = contact->segment;
    distance = distance - chain.at[RADIUS];
    const tuple_dd velocity_at_1 = velocity_at(chain, 0, p_x + distance * n_x, p_y +
        distance * n_y);
    const double v_x = velocity_at_1._0;
    const double v_y = velocity_at_1._1;
    const int owner = whole(chain.at[OWNER]);
    return (ObstacleContact){p_x, p_y, n_x, n_y, distance, v_x, v_y, owner, segment};
}

/* qpavoid.model.contacts: Fill ``contacts`` with those within reach, and always the
 * nearest one. */
static tuple_ii contact_table(matrix edges_, double circumradius, const tuple_mm
    *restrict obstacles, double reach, matrix contacts)
{
    const matrix points = obstacles->_0;
    const matrix capsules = obstacles->_1;
    const tuple_ii point_contacts_1 = point_contacts(edges_, points,
        (tuple_dd){circumradius, reach}, contacts);
    int count = point_contacts_1._0;
    int nearest = point_contacts_1._1;
    double least = nearest_distance(contacts, nearest);
    int end = 0;
    while (end < capsules.rows && nearest > -2) {
        const int begin = end;
        end = chain_end(capsules, end);
        const matrix chain = band(capsules, begin, end);
        const int far = passed_over(chain, circumradius, max2(reach, least));
        if (far < 0) {
            return (tuple_ii){0, -2};
        }
        if (far > 0) {
            continue;
        }
        int features = 1;
        Contact overlap = (Contact){0.0, 0.0, 1.0, 0.0, INFINITY, -1};
        if (has_length(chain, 0)) {
            overlap = separation(edges_, chain);
            if (overlap.distance > 0.0) {
                features = feature_count(edges_, chain);
            }
        }
        const int end_3 = features;
        for (int feature = 0; feature < end_3; feature++) {
            Contact contact = overlap;
            if (overlap.distance > 0.0) {
                contact = feature_contact(edges_, chain, feature);
            }
            const double distance = contact.distance - chain.at[RADIUS];
            if (distance < least) {
                nearest = count;
                least = distance;
            } else if (distance > reach || contact.segment < 0) {
                continue;
            }
            set_contact(contacts, count, (const
                ObstacleContact[]){capsule_contact(&contact, chain)});
            count = count + 1;
        }
    }
    return (tuple_ii){count, nearest};
}

/* qpavoid.model.contacts: Return a row of the table. */
static ObstacleContact contact_at(matrix contacts, int row)
{
    const vector c = row_of(contacts, row);
    const int obstacle = whole(c.at[OBSTACLE]);
    const int segment = whole(c.at[SEGMENT]);
    return (ObstacleContact){c.at[P_X], c.at[P_Y], c.at[NORMAL_X], c.at[NORMAL_Y],
        c.at[DISTANCE], c.at[OBSTACLE_V_X], c.at[OBSTACLE_V_Y], obstacle, segment};
}

/* qpavoid.avoidance.lanes: Return the room of a pose, m, and the speed of what is
 * nearest, m/s. */
static tuple_dd nearest(const LaneSearch *restrict search, const tuple_ddd *restrict
    pose)
{
    in_robot_frame(pose, 0.0, &search->obstacles, &search->seen);
    const matrix contacts = search->contacts;
    const matrix edges_ = search->edges;
    const double radius = search->radius;
    const tuple_ii contact_table_1 = contact_table(edges_, radius, &search->seen, 0.0,
        contacts);
    const int row = contact_table_1._1;
    if (row < 0) {
        return (tuple_dd){INFINITY, 0.0};
    }
    const ObstacleContact c = contact_at(contacts, row);
    return (tuple_dd){c.distance - search->keep, sqrt(c.v_x * c.v_x + c.v_y * c.v_y)};
}

/* qpavoid.avoidance.lanes: Return the share of a time for which a twist may be held
 * from a pose. */
static double free_share(const LaneSearch *restrict search, const tuple_ddd *restrict
    pose, tuple_dd twist, double time)
{
    const double x = pose->_0;
    const double y = pose->_1;
    const double heading = pose->_2;
    const double v = twist._0;
    const double omega = twist._1;
    const tuple_dd nearest_1 = nearest(search, pose);
    double room = nearest_1._0;
    const double level = min2(SPARE, room - NEARER);
    double now = 0.0;
    const double fastest = fabs(v) + fabs(omega) * search->radius;
    while (now < time) {
        const double before = now;
        now = min2(now + max2(room - level, FINE) / fastest, time);
        const tuple_dd nearest_2 = nearest(search, (const tuple_ddd[]){arc(x, y,
            heading, v, omega, now)});
        room = nearest_2._0;
        if (room < level) {
            return before / time;
        }
    }
    return 1.0;
}

/* qpavoid.avoidance.lanes: Return whether the robot can turn to a heading at a pose. */
static bool can_turn(const LaneSearch *restrict search, const tuple_ddd *restrict pose,
    double heading)
{
    const double angle = heading - pose->_2;
    if (search->turn == 0.0) {
        return angle == 0.0;
    }
    const double time = fabs(angle) / search->turn;
    const double omega = copysign(search->turn, angle);
    return free_share(search, pose, (tuple_dd){0.0, omega}, time) == 1.0;
}

/* qpavoid.avoidance.lanes: Return whether the robot can turn to a heading at a pose,
 * and drive on. */
static bool leads_on(const LaneSearch *restrict search, const tuple_ddd *restrict pose,
    double heading)
{
    const double x = pose->_0;
    const double y = pose->_1;
    const double v = search->v;
    const tuple_ddd there = (tuple_ddd){x, y, heading};
    if (nearest(search, &there)._0 < SPARE || !can_turn(search, pose, heading)) {
        return false;
    }
    const double come = copysign(1.0, v) * (x * cos(heading) + y * sin(heading));
    const double time = max2(search->ahead - come, search->radius) / fabs(v);
    return free_share(search, &there, (tuple_dd){v, 0.0}, time) == 1.0;
}

/* qpavoid.avoidance.lanes: Return how far aside the nearest lane along a heading is, m;
 * ``inf``: none. */
static double nearest_lane(const LaneSearch *restrict search, const tuple_ddd *restrict
    pose, double heading, double angle)
{
    const double x = pose->_0;
    const double y = pose->_1;
    const double v = search->v;
    const double toward = heading + angle;
    if (!can_turn(search, pose, toward)) {
        return INFINITY;
    }
    const double time = 1.0 / (fabs(v) * sin(fabs(angle)));
    const double far = LANES_FARTHEST * free_share(search, (const
        tuple_ddd[]){(tuple_ddd){x, y, toward}}, (tuple_dd){v, 0.0}, LANES_FARTHEST *
        time);
    double aside = 0.0;
    double step = APART;
    double found = INFINITY;
    while (step > LANE_PITCH && aside + step <= far) {
        const tuple_ddd at = arc(x, y, toward, v, 0.0, (aside + step) * time);
        if (leads_on(search, &at, heading)) {
            found = aside + step;
            step = 0.5 * step;
        } else {
            aside = aside + step;
        }
    }
    return found;
}

/* qpavoid.avoidance.lanes: Return the nearest lane after backing up so far, m; the
 * right of two as near. */
static Lane best_lane(const LaneSearch *restrict search, double heading, double back)
{
    Lane best = (Lane){INFINITY, 0.0, 0.0, 0.0};
    const double v = search->reverse;
    double time = 0.0;
    if (back > 0.0) {
        time = back / max2(fabs(v), TINY);
        if (v == 0.0 || free_share(search, (const tuple_ddd[]){(tuple_ddd){0.0, 0.0,
            0.0}}, (tuple_dd){v, 0.0}, time) < 1.0) {
            return (Lane){INFINITY, 0.0, 0.0, 0.0};
        }
    }
    const tuple_ddd pose = arc(0.0, 0.0, 0.0, v, 0.0, time);
    const double among_2[] = {-0.5235987755982988, 0.5235987755982988,
        -0.8726646259971648, 0.8726646259971648, -1.2217304763960306,
        1.2217304763960306, -1.5707963267948966, 1.5707963267948966};
    for (int turn_1 = 0; turn_1 < 8; turn_1++) {
        const double angle = among_2[turn_1];
        const double aside = nearest_lane(search, &pose, heading, angle);
        if (aside < best.aside - EQUAL) {
            best = (Lane){aside, angle, aside / sin(fabs(angle)), back};
        }
    }
    return best;
}

/* qpavoid.model.robot: Return :attr:`Robot.limit_vector` by name. */
static RobotLimits limits_of(vector robot_)
{
    const vector r = robot_;
    return (RobotLimits){r.at[0], r.at[1], r.at[2], r.at[3], r.at[4], r.at[5], r.at[6],
        r.at[7], r.at[8]};
}

/* qpavoid.model.robot: Return n, how many control steps braking from (v, ω) takes; at
 * least 1. */
static double braking_steps(vector robot_, double v, double omega, double dt)
{
    const RobotLimits limits = limits_of(robot_);
    double steps = 1.0;
    if (limits.acceleration < INFINITY) {
        steps = max2(steps, fabs(v) / (limits.acceleration * dt));
    }
    if (limits.angular_acceleration < INFINITY) {
        steps = max2(steps, fabs(omega) / (limits.angular_acceleration * dt));
    }
    return ceil(steps - RELATIVE_ROUNDING);
}

/* qpavoid.model.robot: Return u_b, the next twist when braking from (v, ω) along its
 * arc. */
static tuple_dd braking_twist(vector robot_, double v, double omega, double dt)
{
    const double share = 1.0 - 1.0 / braking_steps(robot_, v, omega, dt);
    return (tuple_dd){share * v, share * omega};
}

/* qpavoid.qp.exact: Return (violation, suboptimality) of a twist, judged from the
 * problem alone. */
static tuple_dd certificate(matrix rows, const Terms *restrict terms, double relaxed,
    tuple_dd twist)
{
    const double v = twist._0;
    const double omega = twist._1;
    const Box box = terms->box;
    const int m = rows.rows - 4;
    if (!(isfinite(v) && isfinite(omega))) {
        return (tuple_dd){INFINITY, INFINITY};
    }
    double violation = max2(max2(0.0, box.v_min - v), v - box.v_max);
    violation = max2(max2(violation, box.omega_min - omega), omega - box.omega_max);
    const int end_2 = m;
    for (int i = 0; i < end_2; i++) {
        const double b = i < m - terms->n_hard ? rows.at[i * rows.columns + B] - relaxed
            : rows.at[i * rows.columns + B];
        violation = max2(violation, b - rows.at[i * rows.columns + A_V] * v - rows.at[i
            * rows.columns + A_OMEGA] * omega);
    }
    const double scale_v = sqrt(terms->weights._0);
    const double scale_omega = sqrt(terms->weights._1);
    const double z_1 = v * scale_v;
    const double z_2 = omega * scale_omega;
    const tuple_dd desired = terms->desired;
    const double g_1 = z_1 - desired._0 * scale_v;
    const double g_2 = z_2 - desired._1 * scale_omega;
    const double push = sqrt(g_1 * g_1 + g_2 * g_2);
    if (push < CONFLICT) {
        return (tuple_dd){violation, 0.0};
    }
    double left = 3.141592653589793;
    double right = 3.141592653589793;
    const int end_4 = rows.rows;
    for (int i = 0; i < end_4; i++) {
        const double n_1 = rows.at[i * rows.columns + N_1];
        const double n_2 = rows.at[i * rows.columns + N_2];
        const double c = rows.at[i * rows.columns + C] - relaxed * rows.at[i *
            rows.columns + SOFTNESS];
        if (c > -INFINITY && n_1 * z_1 + n_2 * z_2 - c <= ON_BORDER * (1.0 + fabs(c))) {
            const double angle = atan2(g_1 * n_2 - g_2 * n_1, g_1 * n_1 + g_2 * n_2);
            if (angle >= 0.0) {
                left = min2(left, angle);
            }
            if (angle <= 0.0) {
                right = min2(right, -angle);
            }
        }
    }
    if (left + right < 3.141592653589793) {
        return (tuple_dd){violation, 0.0};
    }
    return (tuple_dd){violation, push * sin(min2(min2(left, right), 0.5 *
        3.141592653589793))};
}

/* qpavoid.avoidance.workspace: Return how many ticks the horizon has. */
static int look_ticks(filter_settings settings_)
{
    const int ticks = whole(rint(settings_->horizon / settings_->tick));
    return ticks;
}

/* qpavoid.avoidance.linearisation: Return how many sides there can be within so many
 * ticks. */
static int most_sides(int ticks)
{
    return quotient(ticks + STRIDE - 1, STRIDE) * SECTORS;
}

/* qpavoid.avoidance.prediction: Return how many arcs a rollout has at most. */
static int most_arcs(filter_settings settings_)
{
    const int steps = whole(ceil(settings_->horizon / settings_->dt));
    return steps + 6;
}

/* qpavoid.avoidance.workspace: Return the memory as the tables of a step. */
static Workspace carve(vector memory, int contacts, filter_settings settings_)
{
    const int sides = most_sides(look_ticks(settings_));
    const int arcs = most_arcs(settings_);
    const int a = contacts * CONTACT_WIDTH;
    const int b = a + (contacts + sides + 8) * WIDTH;
    const int c = b + (sides + 4) * WIDTH;
    const int d = c + contacts * BODY;
    const int e = d + quotient(contacts, FEW) * BODY;
    const int f = e + arcs * ARC;
    const int g = f + sides * SIDE;
    const int h = g + 2 * contacts;
    const int i = h + CAPSULE_WIDTH * contacts;
    const int ticks = look_ticks(settings_) + 1;
    const matrix frames = shaped(part(memory, i, i + 4 * ticks), ticks, 4);
    const matrix inner = shaped(part(memory, b, c), sides + 4, WIDTH);
    return (Workspace){shaped(part(memory, 0, a), contacts, CONTACT_WIDTH),
        shaped(part(memory, a, b), contacts + sides + 8, WIDTH), shaped(part(memory, c,
        d), contacts, BODY), shaped(part(memory, d, e), quotient(contacts, FEW), BODY),
        shaped(part(memory, e, f), arcs, ARC), (Tables){shaped(part(memory, f, g),
        sides, SIDE), inner, frames}, shaped(part(memory, g, h), contacts, 2),
        shaped(part(memory, h, i), contacts, CAPSULE_WIDTH)};
}

/* qpavoid.avoidance.state: Return the sums of |v|, m/s, and of |ω|, rad/s, of the steps
 * on their way. */
static tuple_dd pending_pace(filter_settings settings_, vector state)
{
    const filter_settings s = settings_;
    double v = 0.0;
    double omega = 0.0;
    const int end_2 = whole(ceil(s->delay / s->dt - RELATIVE_ROUNDING));
    for (int i = 0; i < end_2; i++) {
        v = v + fabs(state.at[PENDING + 2 * i]);
        omega = omega + fabs(state.at[PENDING + 2 * i + 1]);
    }
    return (tuple_dd){v, omega};
}

/* qpavoid.avoidance.workspace: Return the scene of a control step with so many bodies;
 * nothing is waived. */
static Scene new_scene(const Setup *restrict setup, vector state, const Workspace
    *restrict space, int count)
{
    const matrix edges_ = setup->edges;
    const vector robot_ = setup->robot;
    const filter_settings settings_ = setup->settings;
    const filter_settings s = setup->settings;
    const tuple_dd last = (tuple_dd){state.at[V], state.at[OMEGA]};
    const tuple_dd pending = pending_pace(settings_, state);
    const double longest = s->dt * (1.0 + s->jitter);
    return (Scene){edges_, robot_, settings_, band(space->bodies, 0, count), last,
        pending, space->arcs, space->groups, longest, 0.0, INFINITY};
}

/* qpavoid.avoidance.ladder: Return the outcome of a step that could not be taken, or
 * not yet. */
static Outcome unsolved(int code, tuple_dd twist, double residual)
{
    const double v = twist._0;
    const double omega = twist._1;
    return (Outcome){code, v, omega, INFINITY, 0.0, residual, 0.0, -1, -1};
}

/* qpavoid.avoidance.barrier_rows: Return ε, m. */
static double tolerated(filter_settings settings_)
{
    return min2(R_MIN_TOLERANCE, 0.5 * settings_->r_min_slow);
}

/* qpavoid.avoidance.scene: Return ε, m. */
static double tolerance(const Scene *restrict scene)
{
    return tolerated(scene->settings);
}

/* qpavoid.avoidance.judge: Return −ε: the least room that keeps clear, m. */
static double lowest(const Scene *restrict scene)
{
    return -tolerance(scene) - REPLAY_ROUNDING;
}

/* qpavoid.avoidance.prediction: Return the plan of one twist. */
static Plan hold(double v, double omega, double end)
{
    return (Plan){v, omega, end, v, omega, end};
}

/* qpavoid.avoidance.prediction: Return an arc that does not depend on the target. */
static Arc arc_from(double begin, const Frame *restrict at, tuple_dd twist, double
    steps)
{
    const double v = twist._0;
    const double omega = twist._1;
    return (Arc){begin, at->x, at->y, at->cos, at->sin, v, omega, steps, 0.0, 0.0};
}

/* qpavoid.avoidance.prediction: Write a row of the table. */
static void set_arc(matrix arcs, int row, const Arc *restrict arc)
{
    const vector a = row_of(arcs, row);
    a.at[0] = arc->begin;
    a.at[1] = arc->x;
    a.at[2] = arc->y;
    a.at[3] = arc->cos;
    a.at[4] = arc->sin;
    a.at[5] = arc->v;
    a.at[6] = arc->omega;
    a.at[7] = arc->steps;
    a.at[SHARE_V] = arc->share_v;
    a.at[SHARE_OMEGA] = arc->share_omega;
}

/* qpavoid.model.kinematics: Return where a constant twist leads from a frame:
 * :func:`arc`, by two sines. */
static Frame moved_on(const Frame *restrict frame, double v, double omega, double time)
{
    const double half = 0.5 * omega * time;
    const double cos_ = cos(half);
    const double sin_ = sin(half);
    const double sinc = fabs(half) > STRAIGHT ? sin_ / half : 1.0 - half * half / 6.0;
    const double chord = v * time * sinc;
    const double d_x = chord * cos_;
    const double d_y = chord * sin_;
    const double turn_cos = 1.0 - 2.0 * sin_ * sin_;
    const double turn_sin = 2.0 * sin_ * cos_;
    return (Frame){frame->x + frame->cos * d_x - frame->sin * d_y, frame->y + frame->sin *
        d_x + frame->cos * d_y, frame->cos * turn_cos - frame->sin * turn_sin, frame->sin *
        turn_cos + frame->cos * turn_sin};
}

/* qpavoid.avoidance.prediction: Return a value after ``many`` steps towards the target,
 * its mean, ∂mean/∂target. */
static tuple_ddd ramp(double now, double target, double step, int many)
{
    const double gap = target - now;
    const double full = min2((double)many, floor(fabs(gap) / step));
    const double moved = copysign(step, gap);
    const double end = full < many ? target : now + many * moved;
    const double rest = (double)many - full;
    const double mean = (full * now + 0.5 * full * (full + 1.0) * moved + rest * target)
        / many;
    return (tuple_ddd){end, full > 0.0 ? mean : target, rest / many};
}

/* qpavoid.model.robot: Return the twists that can follow (v, ω) in dt. */
static Box twist_box(vector robot_, double v, double omega, double dt)
{
    const RobotLimits limits = limits_of(robot_);
    v = min2(max2(v, limits.v_min), limits.v_max);
    omega = min2(max2(omega, limits.omega_min), limits.omega_max);
    const double step_v = limits.acceleration * dt;
    const double step_omega = limits.angular_acceleration * dt;
    return (Box){max2(limits.v_min, v - step_v), min2(limits.v_max, v + step_v),
        max2(limits.omega_min, omega - step_omega), min2(limits.omega_max, omega +
        step_omega)};
}

/* qpavoid.model.robot: Return what the robot drives when it is asked for a twist: the
 * limits, enforced. */
static tuple_dd limit_twist(vector robot_, tuple_dd twist, tuple_dd last, double dt)
{
    const tuple_dd new_1 = last;
    const RobotLimits new_2 = limits_of(robot_);
    double v = twist._0;
    double omega = twist._1;
    const double last_v = new_1._0;
    const double last_omega = new_1._1;
    const RobotLimits limits = new_2;
    const double half = 0.5 * limits.track;
    double fastest = fabs(v) + half * fabs(omega);
    const double most = limits.wheel_speed;
    if (fastest > most) {
        v = v * most / fastest;
        omega = omega * most / fastest;
    }
    const Box box = twist_box(robot_, last_v, last_omega, dt);
    v = min2(max2(v, box.v_min), box.v_max);
    omega = min2(max2(omega, box.omega_min), box.omega_max);
    const double before = fabs(last_v) + half * fabs(last_omega);
    fastest = fabs(v) + half * fabs(omega);
    if (fastest > most && before > (1.0 + RELATIVE_ROUNDING) * most) {
        return braking_twist(robot_, last_v, last_omega, dt);
    }
    if (fastest > max2(most, before)) {
        const double share = max2(most - before, 0.0) / (fastest - before);
        v = last_v + share * (v - last_v);
        omega = last_omega + share * (omega - last_omega);
    }
    return (tuple_dd){v, omega};
}

/* qpavoid.avoidance.prediction: Return the rollout of a plan. */
static Rollout roll_out(const Scene *restrict scene, const Plan *restrict plan, tuple_dd
    now, double held, int many)
{
    double dt = 0;
    double omega = 0;
    double v = 0;
    tuple_dd before = {0};
    const vector robot_ = scene->robot;
    dt = scene->settings->dt;
    const matrix arcs = scene->arcs;
    const RobotLimits limits = limits_of(robot_);
    Frame at = (Frame){0.0, 0.0, 1.0, 0.0};
    double time = 0.0;
    int row = 0;
    const double same = SAME_TIME * dt;
    double speed = 0.0;
    double turning = 0.0;
    double twist_v = now._0;
    double twist_omega = now._1;
    const double last = plan->end - dt;
    if (0.0 < held && held <= last + same) {
        set_arc(arcs, 0, (const Arc[]){arc_from(0.0, &at, now, INFINITY)});
        at = moved_on(&at, now._0, now._1, held);
        time = held;
        row = 1;
        speed = fabs(now._0);
        turning = fabs(now._1);
    }
    for (int part_ = 0; part_ < 2; part_++) {
        double until = last;
        v = plan->v_then;
        omega = plan->omega_then;
        if (part_ == 0) {
            until = min2(plan->switch_, last);
            v = plan->v;
            omega = plan->omega;
        }
        while (time < until - same && row < arcs.rows - 1) {
            double lasts = min2(many * dt, until - time);
            const tuple_ddd ramp_2 = ramp(twist_v, v, limits.acceleration * dt, many);
            double v_end = ramp_2._0;
            double v_mean = ramp_2._1;
            const double v_share = ramp_2._2;
            const tuple_ddd ramp_3 = ramp(twist_omega, omega,
                limits.angular_acceleration * dt, many);
            double w_end = ramp_3._0;
            double w_mean = ramp_3._1;
            const double w_share = ramp_3._2;
            if (many == 1) {
                before = (tuple_dd){twist_v, twist_omega};
                const tuple_dd limit_twist_4 = limit_twist(robot_, (tuple_dd){v, omega},
                    before, dt);
                v_end = limit_twist_4._0;
                w_end = limit_twist_4._1;
                v_mean = v_end;
                w_mean = w_end;
            }
            if (v_mean == v && w_mean == omega) {
                lasts = until - time;
            }
            set_arc(arcs, row, (const Arc[]){arc_from(time, &at, (tuple_dd){v_mean,
                w_mean}, INFINITY)});
            if (part_ == 0) {
                arcs.at[row * arcs.columns + SHARE_V] = v_share;
                arcs.at[row * arcs.columns + SHARE_OMEGA] = w_share;
            }
            at = moved_on(&at, v_mean, w_mean, lasts);
            time = time + lasts;
            row = row + 1;
            speed = max2(speed, fabs(v_mean));
            turning = max2(turning, fabs(w_mean));
            twist_v = v_end;
            twist_omega = w_end;
        }
    }
    if (row > 0 || held == 0.0) {
        v = plan->v_then;
        omega = plan->omega_then;
        if (plan->switch_ > last + same) {
            v = plan->v;
            omega = plan->omega;
        }
        before = (tuple_dd){twist_v, twist_omega};
        const tuple_dd limit_twist_5 = limit_twist(robot_, (tuple_dd){v, omega}, before,
            dt);
        twist_v = limit_twist_5._0;
        twist_omega = limit_twist_5._1;
    }
    const double steps = braking_steps(robot_, twist_v, twist_omega, dt);
    set_arc(arcs, row, (const Arc[]){arc_from(time, &at, (tuple_dd){twist_v,
        twist_omega}, steps)});
    speed = max2(speed, fabs(twist_v));
    turning = max2(turning, fabs(twist_omega));
    const double rest = speed + turning > 0.0 ? time + scene->longest * steps : time;
    return (Rollout){band(arcs, 0, row + 1), speed, turning, rest, (tuple_dd){plan->v,
        plan->omega}};
}

/* qpavoid.avoidance.judge: Return the exact rollout of a plan whose first control step
 * drives a twist. */
static Rollout exact_rollout(const Scene *restrict scene, const Plan *restrict plan,
    tuple_dd twist)
{
    return roll_out(scene, plan, twist, scene->settings->dt, 1);
}

/* qpavoid.avoidance.judge: Return the exact rollout of a twist for one control step,
 * then braking. */
static Rollout rollout_to_rest(const Scene *restrict scene, tuple_dd twist)
{
    return exact_rollout(scene, (const Plan[]){hold(twist._0, twist._1,
        scene->settings->dt)}, twist);
}

/* qpavoid.avoidance.body_table: Return row i of the table, with what is wanted in this
 * scene. */
static Body body_at(const Scene *restrict scene, int i)
{
    const vector b = row_of(scene->bodies, i);
    double keep = b.at[9];
    const double inflation = b.at[10];
    double spread = b.at[11];
    const double kind = b.at[14];
    double now = b.at[16];
    if (kind != MOVES) {
        const double waived = max2(keep - inflation - scene->closest, 0.0);
        keep = keep - waived;
        spread = spread - waived;
        now = now + waived;
    }
    return (Body){b.at[0], b.at[1], b.at[2], b.at[3], b.at[4], b.at[5], b.at[6],
        b.at[7], b.at[8], keep, inflation, spread, b.at[12], b.at[13], kind, b.at[15],
        now, b.at[17]};
}

/* qpavoid.avoidance.body_table: Return whether body i moves. */
static bool moves(const Scene *restrict scene, int i)
{
    return scene->bodies.at[i * scene->bodies.columns + KIND] == MOVES;
}

/* qpavoid.avoidance.motion: Return how fast the distance to keep from a body grows,
 * m/s. */
static double growth_of(const Scene *restrict scene, const Body *restrict body)
{
    return body->growth + (body->kind != MOVES ? scene->drift : 0.0);
}

/* qpavoid.avoidance.motion: Return how fast the circles round footprint and body come
 * nearer at most, m/s. */
static double passing_speed(const Scene *restrict scene, const Rollout *restrict
    rollout, const Body *restrict body)
{
    const double speed = sqrt(square(body->v_x) + square(body->v_y));
    return rollout->speed + speed + growth_of(scene, body);
}

/* qpavoid.avoidance.motion: Return how fast footprint and body come nearer at most,
 * m/s. */
static double closing_speed(const Scene *restrict scene, const Rollout *restrict
    rollout, const Body *restrict body)
{
    const double turning = rollout->turning * limits_of(scene->robot).circumradius;
    const double speed = body->speed + growth_of(scene, body);
    return rollout->speed + turning + speed;
}

/* qpavoid.avoidance.prediction: Return a row of the table. */
static Arc arc_at(matrix arcs, int row)
{
    const vector a = row_of(arcs, row);
    return (Arc){a.at[0], a.at[1], a.at[2], a.at[3], a.at[4], a.at[5], a.at[6], a.at[7],
        a.at[8], a.at[9]};
}

/* qpavoid.avoidance.prediction: Return the index of the arc driven at a time, searched
 * from ``row`` on. */
static int arc_index(matrix arcs, int row, double time)
{
    while (row + 1 < arcs.rows && arc_at(arcs, row + 1).begin <= time) {
        row = row + 1;
    }
    return row;
}

/* qpavoid.avoidance.prediction: Return how long (v, ω) drives to where braking in n
 * steps has come by a time, s. */
static double braking_place(double time, double steps, double dt)
{
    if (steps == INFINITY) {
        return time;
    }
    const double k = min2(floor(time / dt), steps);
    const double place = dt * (k - 0.5 * k * (k - 1.0) / steps);
    return place + (time - dt * k) * (1.0 - k / steps);
}

/* qpavoid.avoidance.prediction: Return where the robot is at a time on an arc of a
 * rollout. */
static Frame frame_at(const Arc *restrict arc, double time, double dt)
{
    const Frame at = (Frame){arc->x, arc->y, arc->cos, arc->sin};
    double place = 0.0;
    if (time > arc->begin) {
        place = braking_place(time - arc->begin, arc->steps, dt);
    }
    return place != 0.0 ? moved_on(&at, arc->v, arc->omega, place) : at;
}

/* qpavoid.avoidance.motion: Return the room of the circles round footprint and body, m:
 * never too much. */
static double circle_room(const Scene *restrict scene, const Body *restrict body, double
    time, const Frame *restrict at)
{
    const double d_x = body->x + time * body->v_x - at->x;
    const double d_y = body->y + time * body->v_y - at->y;
    const double apart = sqrt(d_x * d_x + d_y * d_y);
    return apart - limits_of(scene->robot).circumradius - body->spread;
}

/* qpavoid.avoidance.body_table: Return whether a body has no length. */
static bool is_point(const Body *restrict body)
{
    return body->spread == body->keep;
}

/* qpavoid.avoidance.motion: Return the ends of a body at a time, as seen from a frame.
 * */
static Ends ends_at(const Body *restrict body, double time, const Frame *restrict at)
{
    const double v_x = body->v_x;
    const double v_y = body->v_y;
    const double c = at->cos;
    const double s = at->sin;
    const double p_x = body->x + time * v_x - at->x;
    const double p_y = body->y + time * v_y - at->y;
    if (is_point(body)) {
        const double x = c * p_x + s * p_y;
        const double y = c * p_y - s * p_x;
        const End end = (End){x, y, c * v_x + s * v_y, c * v_y - s * v_x};
        return (Ends){end, end};
    }
    double x1 = body->x1;
    double y1 = body->y1;
    double x2 = body->x2;
    double y2 = body->y2;
    const double spin = body->turn;
    if (spin != 0.0) {
        const double cos_ = cos(spin * time);
        const double sin_ = sin(spin * time);
        const double new_1 = sin_ * x1 + cos_ * y1;
        x1 = cos_ * x1 - sin_ * y1;
        y1 = new_1;
        const double new_2 = sin_ * x2 + cos_ * y2;
        x2 = cos_ * x2 - sin_ * y2;
        y2 = new_2;
    }
    const double v_x1 = v_x - spin * y1;
    const double v_y1 = v_y + spin * x1;
    const double v_x2 = v_x - spin * y2;
    const double v_y2 = v_y + spin * x2;
    x1 = p_x + x1;
    y1 = p_y + y1;
    x2 = p_x + x2;
    y2 = p_y + y2;
    const double w_x1 = c * v_x1 + s * v_y1;
    const double w_y1 = c * v_y1 - s * v_x1;
    const double w_x2 = c * v_x2 + s * v_y2;
    const double w_y2 = c * v_y2 - s * v_x2;
    const double new_3 = c * y1 - s * x1;
    x1 = c * x1 + s * y1;
    y1 = new_3;
    const double new_4 = c * y2 - s * x2;
    x2 = c * x2 + s * y2;
    y2 = new_4;
    return (Ends){(End){x1, y1, w_x1, w_y1}, (End){x2, y2, w_x2, w_y2}};
}

/* qpavoid.model.contact: Return the nearest of a wall's contacts; the way out where it
 * cuts. */
static Contact wall_contact(matrix edges_, const Segment *restrict wall)
{
    Contact contact = wall_separation(edges_, wall);
    if (contact.distance <= 0.0) {
        return contact;
    }
    contact = point_contact(edges_, wall->x1, wall->y1);
    const Contact end = point_contact(edges_, wall->x2, wall->y2);
    if (end.distance < contact.distance) {
        contact = end;
    }
    const int end_2 = edges_.rows;
    for (int corner = 0; corner < end_2; corner++) {
        const Contact side = corner_contact(edges_, corner, wall);
        if (side.distance < contact.distance) {
            contact = side;
        }
    }
    return contact;
}

/* qpavoid.avoidance.motion: Return the contact of the footprint with the line of a
 * body. */
static Contact line_contact(matrix edges_, const Body *restrict body, const Ends
    *restrict ends)
{
    const End one = ends->one;
    const End other = ends->other;
    if (is_point(body)) {
        return point_contact(edges_, one.x, one.y);
    }
    return wall_contact(edges_, (const Segment[]){(Segment){one.x, one.y, other.x,
        other.y}});
}

/* qpavoid.avoidance.prediction: Return the share of the twist that is driven at a time
 * after its arc began. */
static double braking_share(double time, double steps, double dt)
{
    if (steps == INFINITY) {
        return 1.0;
    }
    return max2(1.0 - floor(time / dt + RELATIVE_ROUNDING) / steps, 0.0);
}

/* qpavoid.avoidance.time_bounds: Return what is driven at a time on an arc. */
static ArcTwist arc_twist(const Arc *restrict arc, double time, double dt)
{
    const double share = braking_share(time - arc->begin, arc->steps, dt);
    return (ArcTwist){share * arc->v, share * arc->omega, arc->steps < INFINITY};
}

/* qpavoid.avoidance.time_bounds: Return the least τ with room + rate·τ − ½ bend·τ² = 0;
 * room and bend ≥ 0. */
static double time_to_lose(double room, double rate, double bend)
{
    const double root = sqrt(rate * rate + 2.0 * bend * room);
    if (rate < 0.0) {
        return 2.0 * room / (root - rate);
    }
    return bend > NO_BEND ? (rate + root) / bend : INFINITY;
}

/* qpavoid.avoidance.time_bounds: Return a lower bound of the time until an end crosses
 * a line, s. */
static double end_time(const Contact *restrict contact, const End *restrict end, const
    ArcTwist *restrict driven, const tuple_ddd *restrict line)
{
    const double n_x = contact->n_x;
    const double n_y = contact->n_y;
    const double fast = fabs(driven->omega);
    const double x = end->x;
    const double y = end->y;
    const double v_x = end->v_x;
    const double v_y = end->v_y;
    const double floor_ = line->_0;
    const double growth = line->_1;
    const double spin = line->_2;
    const double spare = max2(n_x * x + n_y * y - floor_ - BOUND_ROUNDING, 0.0);
    double away = -n_x * (driven->v - driven->omega * y) - n_y * driven->omega * x;
    if (driven->brakes) {
        away = min2(away, 0.0);
    }
    double bend = fast * fast * (n_x * x + n_y * y) - driven->omega * driven->v * n_y;
    bend = max2(bend, 0.0) + max2(away, 0.0) * fast / 3.0;
    bend = bend + (2.0 * fast * sqrt(v_x * v_x + v_y * v_y) + spin);
    const double time = time_to_lose(spare, away + n_x * v_x + n_y * v_y - growth,
        bend);
    return away > 0.0 && fast > 0.0 ? min2(time, 1.0 / fast) : time;
}

/* qpavoid.avoidance.time_bounds: Return a lower bound of the time until the line of a
 * body is too near, s. */
static double line_time(const Body *restrict body, const Contact *restrict contact,
    const Ends *restrict ends, const ArcTwist *restrict driven, tuple_dd keep)
{
    const double floor_ = contact->n_x * contact->x + contact->n_y * contact->y + keep._0;
    const double square_ = body->turn * body->turn;
    double spin = square_ * sqrt(square(body->x1) + square(body->y1));
    const double time = end_time(contact, &ends->one, driven, (const
        tuple_ddd[]){(tuple_ddd){floor_, keep._1, spin}});
    if (is_point(body)) {
        return time;
    }
    spin = square_ * sqrt(square(body->x2) + square(body->y2));
    return min2(time, end_time(contact, &ends->other, driven, (const
        tuple_ddd[]){(tuple_ddd){floor_, keep._1, spin}}));
}

/* qpavoid.avoidance.advancement: Return whether body i has less room than a level
 * within a span, and when first. */
static tuple_bd too_near(const Scene *restrict scene, const Rollout *restrict rollout,
    int i, tuple_dd span, double level, double slack)
{
    double wait = 0;
    const matrix arcs = rollout->arcs;
    const double dt = scene->longest;
    double time = span._0;
    const double end = span._1;
    const Body body = body_at(scene, i);
    const int count = arcs.rows;
    int row = 0;
    const double growth = growth_of(scene, &body);
    const double passing = passing_speed(scene, rollout, &body);
    const double pace = closing_speed(scene, rollout, &body);
    const int end_2 = LOOKS + count;
    for (int turn_1 = 0; turn_1 < end_2; turn_1++) {
        row = arc_index(arcs, row, time);
        const Arc arc = arc_at(arcs, row);
        const Frame at = frame_at(&arc, time, dt);
        const double spare = circle_room(scene, &body, time, &at) - growth * time -
            level;
        if (spare > AFAR) {
            wait = passing > 0.0 ? spare / passing : INFINITY;
        } else {
            const Ends ends = ends_at(&body, time, &at);
            const Contact contact = line_contact(scene->edges, &body, &ends);
            const double keep = body.keep + growth * time + level;
            if (contact.distance < keep) {
                return (tuple_bd){true, time};
            }
            const ArcTwist driven = arc_twist(&arc, time, dt);
            const double least = keep - slack;
            wait = line_time(&body, &contact, &ends, &driven, (tuple_dd){least,
                growth});
            if (row + 1 < count) {
                wait = min2(wait, arc_at(arcs, row + 1).begin - time);
            }
            if (pace > 0.0) {
                wait = max2(wait, (contact.distance - least - BOUND_ROUNDING) / pace);
            }
        }
        time = time + wait;
        if (time >= end) {
            return (tuple_bd){false, end};
        }
    }
    return (tuple_bd){true, time};
}

/* qpavoid.avoidance.ladder: Return whether a twist resolves contacts with static
 * bodies, or is rest. */
static bool leaves_standing(const Scene *restrict scene, tuple_dd twist)
{
    if (twist._0 == 0.0 && twist._1 == 0.0) {
        return true;
    }
    const filter_settings s = scene->settings;
    const Rollout rollout = rollout_to_rest(scene, twist);
    const int end_2 = scene->bodies.rows;
    for (int i = 0; i < end_2; i++) {
        const Body body = body_at(scene, i);
        const bool touched = body.keep - tolerance(scene) < body.inflation;
        if (!moves(scene, i) && touched) {
            const tuple_dd span = (tuple_dd){s->dt, max2(rollout.rest, s->dt)};
            const double level = ROW_ROUNDING - tolerance(scene);
            const tuple_bd too_near_3 = too_near(scene, &rollout, i, span, level, 0.0);
            const bool near = too_near_3._0;
            if (near) {
                return false;
            }
        }
    }
    return true;
}

/* qpavoid.avoidance.judge: Return whether nothing that moves touches the robot before
 * it has braked. */
static bool rests_in_time(const Scene *restrict scene, tuple_dd twist)
{
    const Rollout rollout = rollout_to_rest(scene, twist);
    const int end_2 = scene->bodies.rows;
    for (int i = 0; i < end_2; i++) {
        if (moves(scene, i) && rollout.rest > 0.0) {
            const Body body = body_at(scene, i);
            const double level = body.inflation - body.keep;
            const tuple_bd too_near_3 = too_near(scene, &rollout, i, (tuple_dd){0.0,
                rollout.rest}, level, 0.0);
            const bool near = too_near_3._0;
            if (near) {
                return false;
            }
        }
    }
    return true;
}

/* qpavoid.avoidance.ladder: Return whether a twist resolves contacts, or is rest. */
static bool leaves_contact(const Scene *restrict scene, const Prepared *restrict
    prepared, tuple_dd twist, double room)
{
    const filter_settings s = scene->settings;
    const bool touches = prepared->clearance <= 0.0;
    if (touches && !leaves_standing(scene, twist)) {
        return false;
    }
    const bool caught = (int)s->passive != 0 && (touches || room < -s->r_min_slow);
    return !caught || rests_in_time(scene, twist);
}

/* qpavoid.avoidance.ladder: Return whether a plan is to stand still. */
static bool is_rest(const Plan *restrict plan)
{
    const tuple_dd first = (tuple_dd){plan->v, plan->omega};
    const tuple_dd then = (tuple_dd){plan->v_then, plan->omega_then};
    return (first._0 == 0.0 && first._1 == 0.0) && (then._0 == 0.0 && then._1 == 0.0);
}

/* qpavoid.avoidance.state: Remember the twist driven and its plan, as it will be after
 * this step. */
static void keep_plan(vector state, tuple_dd twist, const Plan *restrict plan, double
    until, double dt)
{
    state.at[V] = twist._0;
    state.at[OMEGA] = twist._1;
    state.at[PLAN_V] = plan->v;
    state.at[PLAN_OMEGA] = plan->omega;
    const double new_1 = max2(plan->end - dt, 0.0);
    state.at[SWITCH] = max2(plan->switch_ - dt, 0.0);
    state.at[END] = new_1;
    state.at[THEN_V] = plan->v_then;
    state.at[THEN_OMEGA] = plan->omega_then;
    state.at[UNTIL] = max2(until - dt, 0.0);
    const int end_3 = PENDING + 1;
    for (int i = STATE_SIZE - 1; i > end_3; i += -1) {
        state.at[i] = state.at[i - 2];
    }
    state.at[PENDING] = twist._0;
    state.at[PENDING + 1] = twist._1;
}

/* qpavoid.avoidance.ladder: Remember what is driven where the answer of the QP is not;
 * return the outcome. */
static Outcome driven(const Scene *restrict scene, const Prepared *restrict prepared,
    const Choice *restrict choice, vector state)
{
    keep_plan(state, choice->twist, &choice->plan, choice->until, scene->settings->dt);
    const double shortfall = choice->room < lowest(scene) ? -choice->room : 0.0;
    const int owner = prepared->target.owner;
    const double v = choice->twist._0;
    const double omega = choice->twist._1;
    const double clearance = prepared->clearance;
    const double residual = choice->residual;
    return (Outcome){choice->code, v, omega, clearance, 0.0, residual, shortfall, owner,
        -1};
}

/* qpavoid.avoidance.scene: Return the scene with other bodies, drift and ``closest``.
 * */
static Scene altered(const Scene *restrict scene, matrix bodies, double drift, double
    closest)
{
    const matrix e = scene->edges;
    const vector r = scene->robot;
    const filter_settings s = scene->settings;
    const tuple_dd last = scene->last;
    const tuple_dd pending = scene->pending;
    const matrix arcs = scene->arcs;
    const matrix groups = scene->groups;
    const double longest = scene->longest;
    return (Scene){e, r, s, bodies, last, pending, arcs, groups, longest, drift,
        closest};
}

/* qpavoid.avoidance.motion: Return whether body i keeps a level of room up to a time,
 * by its circle alone. */
static bool stays_away(const Scene *restrict scene, const Rollout *restrict rollout, int
    i, double end, double level)
{
    const Body body = body_at(scene, i);
    double far = limits_of(scene->robot).circumradius + body.spread + level;
    far = far + passing_speed(scene, rollout, &body) * end;
    return far < 0.0 || body.x * body.x + body.y * body.y > far * far;
}

/* qpavoid.avoidance.broad_phase: Return whether a group keeps a level of room up to a
 * time, and more at a look. */
static bool is_far(const Scene *restrict scene, const Rollout *restrict rollout, int
    row, tuple_dd wanted)
{
    const double end = wanted._0;
    const double level = wanted._1;
    bool near = false;
    const Scene groups = altered(scene, scene->groups, scene->drift, scene->closest);
    if (!stays_away(&groups, rollout, row, end, level)) {
        const tuple_bd too_near_1 = too_near(&groups, rollout, row, (tuple_dd){0.0,
            end}, level + SPARE, SPARE);
        near = too_near_1._0;
    }
    return !near;
}

/* qpavoid.avoidance.broad_phase: Return the first body from i on that may come too
 * near; their number: none. */
static int next_body(const Scene *restrict scene, const Rollout *restrict rollout, int
    i, const Watch *restrict watch)
{
    const int count = scene->bodies.rows;
    while (i < count) {
        const int row = whole(scene->bodies.at[i * scene->bodies.columns + GROUP]);
        tuple_dd wanted = watch->still;
        if (moves(scene, i)) {
            wanted = watch->moving;
        }
        const double end = wanted._0;
        const double level = wanted._1;
        if (row >= 0 && (end < 0.0 || is_far(scene, rollout, row, wanted))) {
            i = whole(scene->groups.at[row * scene->groups.columns + BROAD_PHASE_OWNER]);
        } else if (end < 0.0 || stays_away(scene, rollout, i, end, level)) {
            i = i + 1;
        } else {
            return i;
        }
    }
    return count;
}

/* qpavoid.avoidance.advancement: Return the room of body i at a time, m. */
static double room_at(const Scene *restrict scene, const Rollout *restrict rollout, int
    i, double time)
{
    const Body body = body_at(scene, i);
    const Arc arc = arc_at(rollout->arcs, arc_index(rollout->arcs, 0, time));
    const Ends ends = ends_at(&body, time, (const Frame[]){frame_at(&arc, time,
        scene->longest)});
    const double distance = line_contact(scene->edges, &body, &ends).distance;
    return distance - body.keep - growth_of(scene, &body) * time;
}

/* qpavoid.avoidance.advancement: Return the least room of body i as far as it is found,
 * m, and when it is. */
static tuple_dd least_room(const Scene *restrict scene, const Rollout *restrict rollout,
    int i, tuple_dd span, double enough)
{
    double room = 0;
    const matrix arcs = rollout->arcs;
    const double dt = scene->longest;
    double time = span._0;
    const double end = span._1;
    const Body body = body_at(scene, i);
    double least = enough;
    double when = -1.0;
    int row = 0;
    const double passing = passing_speed(scene, rollout, &body);
    const double pace = closing_speed(scene, rollout, &body);
    double step = max2(STEP, (end - time) / LOOKS);
    const int end_2 = LOOKS + 1;
    for (int turn_1 = 0; turn_1 < end_2; turn_1++) {
        row = arc_index(arcs, row, time);
        const Frame at = frame_at((const Arc[]){arc_at(arcs, row)}, time, dt);
        const double growth = growth_of(scene, &body) * time;
        room = circle_room(scene, &body, time, &at) - growth;
        double speed = passing;
        if (room < least + AFAR) {
            const Contact contact = line_contact(scene->edges, &body, (const
                Ends[]){ends_at(&body, time, &at)});
            room = contact.distance - body.keep - growth;
            speed = pace;
            if (room < least) {
                least = room;
                when = time;
            }
        }
        if (time >= end) {
            break;
        }
        double steps = 1.0;
        const double way = speed * step;
        if (way > 0.0) {
            steps = max2(floor(min2((room - least) / way, MOST_STEPS)), 1.0);
        }
        time = min2(time + steps * step, end);
    }
    const int end_4 = when >= 0.0 ? REFINEMENTS : 0;
    for (int turn_3 = 0; turn_3 < end_4; turn_3++) {
        step = step * 0.5;
        for (int side = 0; side < 2; side++) {
            time = min2(max2(when + (2 * side - 1) * step, span._0), end);
            room = room_at(scene, rollout, i, time);
            if (room < least) {
                least = room;
                when = time;
            }
        }
    }
    return (tuple_dd){least, when};
}

/* qpavoid.avoidance.judge: Return the least room of what stands until the robot does,
 * m, or ``enough``. */
static double standing_room(const Scene *restrict scene, const Rollout *restrict
    rollout, double enough)
{
    double least = enough;
    const Watch watch = (Watch){(tuple_dd){-1.0, 0.0}, (tuple_dd){rollout->rest,
        enough}};
    int i = next_body(scene, rollout, 0, &watch);
    while (i < scene->bodies.rows) {
        const tuple_dd least_room_1 = least_room(scene, rollout, i, (tuple_dd){0.0,
            rollout->rest}, enough);
        const double room = least_room_1._0;
        least = min2(least, room);
        i = next_body(scene, rollout, i + 1, &watch);
    }
    return least;
}

/* qpavoid.avoidance.judge: Return the least room of all that moves up to the horizon,
 * m, or ``enough``. */
static double moving_room(const Scene *restrict scene, const Rollout *restrict rollout,
    double enough)
{
    double least = enough;
    const int end_2 = scene->bodies.rows;
    for (int i = 0; i < end_2; i++) {
        if (moves(scene, i)) {
            const tuple_dd span = (tuple_dd){0.0, scene->settings->horizon};
            const tuple_dd least_room_3 = least_room(scene, rollout, i, span, least);
            least = least_room_3._0;
        }
    }
    return least;
}

/* qpavoid.avoidance.judge: Return whether only braking along the arc is known to be
 * followed. */
static bool is_inexact(const Scene *restrict scene)
{
    const filter_settings s = scene->settings;
    return s->jitter > 0.0 || (int)s->ramps != 0;
}

/* qpavoid.avoidance.state: Return what is left of the plan of the twist driven last. */
static Plan kept_plan(vector state)
{
    return (Plan){state.at[PLAN_V], state.at[PLAN_OMEGA], state.at[SWITCH],
        state.at[THEN_V], state.at[THEN_OMEGA], state.at[END]};
}

/* qpavoid.avoidance.judge: Return the twist that a plan aims at in the coming control
 * step. */
static tuple_dd first_target(const Scene *restrict scene, const Plan *restrict plan)
{
    if (plan->switch_ < 0.5 * scene->settings->dt) {
        return (tuple_dd){plan->v_then, plan->omega_then};
    }
    return (tuple_dd){plan->v, plan->omega};
}

/* qpavoid.avoidance.judge: Return what a plan drives in the coming control step. */
static tuple_dd first_twist(const Scene *restrict scene, const Plan *restrict plan)
{
    const filter_settings s = scene->settings;
    if (plan->end < 0.5 * s->dt) {
        return braking_twist(scene->robot, scene->last._0, scene->last._1, s->dt);
    }
    return limit_twist(scene->robot, first_target(scene, plan), scene->last, s->dt);
}

/* qpavoid.avoidance.broad_phase: Return whether no body comes too near. */
static bool keeps_all(const Scene *restrict scene, const Rollout *restrict rollout,
    const Watch *restrict watch)
{
    int i = next_body(scene, rollout, 0, watch);
    while (i < scene->bodies.rows) {
        const tuple_dd moves_1 = moves(scene, i) ? watch->moving : watch->still;
        const double end = moves_1._0;
        const double level = moves_1._1;
        const tuple_bd too_near_2 = too_near(scene, rollout, i, (tuple_dd){0.0, end},
            level, 0.0);
        const bool near = too_near_2._0;
        if (near) {
            return false;
        }
        i = next_body(scene, rollout, i + 1, watch);
    }
    return true;
}

/* qpavoid.avoidance.judge: Return whether a rollout keeps clear of all static bodies
 * until it rests. */
static bool keeps_from_standing(const Scene *restrict scene, const Rollout *restrict
    rollout, double level)
{
    return keeps_all(scene, rollout, (const Watch[]){(Watch){(tuple_dd){-1.0, 0.0},
        (tuple_dd){rollout->rest, level}}});
}

/* qpavoid.avoidance.judge: Return whether a twist, braked away next, leaves what stands
 * no less room. */
static bool no_worse_than(const Scene *restrict scene, tuple_dd brake, tuple_dd twist)
{
    Rollout rollout = rollout_to_rest(scene, twist);
    const double level = lowest(scene);
    const Watch watch = (Watch){(tuple_dd){-1.0, 0.0}, (tuple_dd){rollout.rest, level}};
    int i = next_body(scene, &rollout, 0, &watch);
    while (i < scene->bodies.rows) {
        const Rollout stop = rollout_to_rest(scene, brake);
        const tuple_dd least_room_1 = least_room(scene, &stop, i, (tuple_dd){0.0,
            stop.rest}, level);
        const double room = least_room_1._0;
        rollout = rollout_to_rest(scene, twist);
        const tuple_dd end = (tuple_dd){0.0, rollout.rest};
        const tuple_bd too_near_2 = too_near(scene, &rollout, i, end, room -
            REPLAY_ROUNDING, 0.0);
        const bool near = too_near_2._0;
        if (near) {
            return false;
        }
        i = next_body(scene, &rollout, i + 1, &watch);
    }
    return true;
}

/* qpavoid.avoidance.ladder: Return the outcome of the fallbacks: plan found, plan kept,
 * braking. */
static Outcome fall_back(const Scene *restrict scene, const Prepared *restrict prepared,
    const Outcome *restrict rejected, vector state)
{
    tuple_dd twist = {0};
    const filter_settings s = scene->settings;
    const double level = lowest(scene);
    const Target target = prepared->target;
    int code = rejected->code;
    const double residual = rejected->residual;
    const bool solved = code != STOPPED;
    if (prepared->ahead && target.mode != STUCK && solved) {
        if (leaves_contact(scene, prepared, prepared->anchor, target.room)) {
            const bool rests = (prepared->anchor._0 == 0.0 && prepared->anchor._1 == 0.0)
                && is_rest(&target.plan);
            code = rests ? HOLDING : PLANNED;
            if (target.room < level) {
                code = RELAXED;
            }
            const double until = target.mode == CARRIED ? state.at[UNTIL] : s->horizon;
            const Choice found = (Choice){code, prepared->anchor, target.plan,
                target.room, until, 0.0};
            return driven(scene, prepared, &found, state);
        }
    }
    const tuple_dd brake = braking_twist(scene->robot, scene->last._0, scene->last._1,
        s->dt);
    Plan plan = hold(brake._0, brake._1, s->dt);
    const Rollout stop = rollout_to_rest(scene, brake);
    const double braked = standing_room(scene, &stop, level);
    const double met = moving_room(scene, &stop, 0.0);
    if (solved) {
        code = brake._0 == 0.0 && brake._1 == 0.0 ? HOLDING : BRAKING;
    }
    double room = min2(met, braked < level ? braked : 0.0);
    Choice choice = (Choice){code, brake, plan, room, state.at[UNTIL], residual};
    if (is_inexact(scene)) {
        return driven(scene, prepared, &choice, state);
    }
    const Plan kept = kept_plan(state);
    if (state.at[END] > 0.5 * s->dt) {
        twist = first_twist(scene, &kept);
        const Rollout rollout = exact_rollout(scene, &kept, twist);
        room = moving_room(scene, &rollout, 0.0);
        const bool better = braked < level || room > met + ALIKE;
        if (better && keeps_from_standing(scene, &rollout, level)) {
            if (leaves_contact(scene, prepared, twist, room)) {
                if (solved) {
                    code = room >= level ? PLANNED : RELAXED;
                }
                choice = (Choice){code, twist, kept, room, state.at[UNTIL], residual};
                return driven(scene, prepared, &choice, state);
            }
        }
    }
    twist = (tuple_dd){rejected->v, rejected->omega};
    if (braked < level && solved && no_worse_than(scene, brake, twist)) {
        plan = hold(twist._0, twist._1, s->dt);
        choice = (Choice){RELAXED, twist, plan, choice.room, state.at[UNTIL], residual};
    }
    return driven(scene, prepared, &choice, state);
}

/* qpavoid.avoidance.step: Return the nearest twist of a box. */
static tuple_dd clipped(tuple_dd twist, const Box *restrict box)
{
    double v = twist._0;
    const double omega = twist._1;
    v = min2(max2(v, box->v_min), box->v_max);
    return (tuple_dd){v, min2(max2(omega, box->omega_min), box->omega_max)};
}

/* qpavoid.avoidance.step: Return the limits of an attempt: a box about the anchor,
 * within the limits. */
static Box trust_box(const Prepared *restrict prepared, int attempt, tuple_dd rejected)
{
    if (attempt == 0) {
        return prepared->box;
    }
    const Box box = prepared->box;
    const double share = ((const double[]){INFINITY, 0.5, 0.25})[attempt];
    const tuple_dd clipped_1 = clipped(prepared->anchor, &box);
    const double v = clipped_1._0;
    const double omega = clipped_1._1;
    const double d_v = share * fabs(rejected._0 - v);
    const double d_omega = share * fabs(rejected._1 - omega);
    return (Box){max2(box.v_min, v - d_v), min2(box.v_max, v + d_v), max2(box.omega_min,
        omega - d_omega), min2(box.omega_max, omega + d_omega)};
}

/* qpavoid.qp.exact: Write half-plane i: n_1 and n_2, c and softness. */
static void set_plane(matrix rows, int i, tuple_dd normal, tuple_dd offset)
{
    rows.at[i * rows.columns + N_1] = normal._0;
    rows.at[i * rows.columns + N_2] = normal._1;
    rows.at[i * rows.columns + C] = offset._0;
    rows.at[i * rows.columns + SOFTNESS] = offset._1;
}

/* qpavoid.qp.exact: Fill in n·z ≥ c − s·softness for rows and limits, and return a
 * least s, m/s. */
static double half_planes(matrix rows, const Terms *restrict terms)
{
    const int m = rows.rows - 4;
    double least = 0.0;
    const Box box = terms->box;
    const double scale_v = sqrt(terms->weights._0);
    const double scale_omega = sqrt(terms->weights._1);
    const double per_v = 1.0 / scale_v;
    const double per_omega = 1.0 / scale_omega;
    const int end_2 = m;
    for (int i = 0; i < end_2; i++) {
        const double n_1 = rows.at[i * rows.columns + A_V] * per_v;
        const double n_2 = rows.at[i * rows.columns + A_OMEGA] * per_omega;
        const double length = sqrt(n_1 * n_1 + n_2 * n_2);
        if (length < NULL_ROW) {
            least = max2(least, rows.at[i * rows.columns + B]);
            set_plane(rows, i, (tuple_dd){0.0, 0.0}, (tuple_dd){-INFINITY, 0.0});
        } else {
            const double per = 1.0 / length;
            const double softness = i < m - terms->n_hard ? per : 0.0;
            set_plane(rows, i, (tuple_dd){n_1 * per, n_2 * per}, (tuple_dd){rows.at[i *
                rows.columns + B] * per, softness});
        }
    }
    set_plane(rows, m, (tuple_dd){1.0, 0.0}, (tuple_dd){box.v_min * scale_v, 0.0});
    set_plane(rows, m + 1, (tuple_dd){-1.0, 0.0}, (tuple_dd){-box.v_max * scale_v,
        0.0});
    set_plane(rows, m + 2, (tuple_dd){0.0, 1.0}, (tuple_dd){box.omega_min * scale_omega,
        0.0});
    set_plane(rows, m + 3, (tuple_dd){0.0, -1.0}, (tuple_dd){-box.omega_max *
        scale_omega, 0.0});
    return least;
}

/* qpavoid.qp.exact: Return the slack at which half-planes i, j and k just meet (k = −1:
 * only two). */
static double slack_of_conflict(matrix rows, int i, int j, int k)
{
    double l_i = 0;
    double l_j = 0;
    double l_k = 0;
    if (k < 0) {
        l_i = 1.0;
        l_j = 1.0;
        l_k = 0.0;
    } else {
        l_i = max2(rows.at[j * rows.columns + N_1] * rows.at[k * rows.columns + N_2] -
            rows.at[j * rows.columns + N_2] * rows.at[k * rows.columns + N_1], 0.0);
        l_j = max2(rows.at[k * rows.columns + N_1] * rows.at[i * rows.columns + N_2] -
            rows.at[k * rows.columns + N_2] * rows.at[i * rows.columns + N_1], 0.0);
        l_k = max2(rows.at[i * rows.columns + N_1] * rows.at[j * rows.columns + N_2] -
            rows.at[i * rows.columns + N_2] * rows.at[j * rows.columns + N_1], 0.0);
    }
    double offset = l_i * rows.at[i * rows.columns + C] + l_j * rows.at[j * rows.columns
        + C];
    double softness = l_i * rows.at[i * rows.columns + SOFTNESS] + l_j * rows.at[j *
        rows.columns + SOFTNESS];
    if (k >= 0) {
        offset = offset + l_k * rows.at[k * rows.columns + C];
        softness = softness + l_k * rows.at[k * rows.columns + SOFTNESS];
    }
    return softness > 0.0 ? offset / softness : INFINITY;
}

/* qpavoid.qp.exact: Return the point that all half-planes share nearest to (z_1, z_2).
 * */
static Projection nearest_point(matrix rows, double z_1, double z_2, double slack)
{
    double c = 0;
    double wanted = 0;
    const int n = rows.rows;
    double p_1 = z_1;
    double p_2 = z_2;
    int first = -1;
    int second = -1;
    const double scale = 1.0 + fabs(z_1) + fabs(z_2);
    const int end_2 = n;
    for (int count = 0; count < end_2; count++) {
        int worst = -1;
        double depth = 0.0;
        const int end_4 = n;
        for (int i = 0; i < end_4; i++) {
            c = rows.at[i * rows.columns + C] - slack * rows.at[i * rows.columns +
                SOFTNESS];
            const double gap = c - rows.at[i * rows.columns + N_1] * p_1 - rows.at[i *
                rows.columns + N_2] * p_2;
            if (gap > depth && gap > VIOLATED * (scale + fabs(c))) {
                worst = i;
                depth = gap;
            }
        }
        if (worst < 0) {
            break;
        }
        const double n_1 = rows.at[worst * rows.columns + N_1];
        const double n_2 = rows.at[worst * rows.columns + N_2];
        c = rows.at[worst * rows.columns + C] - slack * rows.at[worst * rows.columns +
            SOFTNESS];
        const double beyond = c - n_1 * z_1 - n_2 * z_2;
        const double foot_1 = z_1 + beyond * n_1;
        const double foot_2 = z_2 + beyond * n_2;
        double low = -INFINITY;
        double high = INFINITY;
        int at_low = -1;
        int at_high = -1;
        const int end_6 = count;
        for (int k = 0; k < end_6; k++) {
            const int j = whole(rows.at[k * rows.columns + CHOSEN]);
            c = rows.at[j * rows.columns + C] - slack * rows.at[j * rows.columns +
                SOFTNESS];
            const double rate = n_1 * rows.at[j * rows.columns + N_2] - n_2 * rows.at[j
                * rows.columns + N_1];
            double need = c - rows.at[j * rows.columns + N_1] * foot_1 - rows.at[j *
                rows.columns + N_2] * foot_2;
            need = need - GRANTED * (scale + fabs(c));
            if (fabs(rate) < PARALLEL) {
                if (need > CONFLICT * (scale + fabs(c))) {
                    wanted = slack_of_conflict(rows, worst, j, -1);
                    return (Projection){false, p_1, p_2, worst, j, wanted};
                }
            } else if (rate > 0.0 && need / rate > low) {
                low = need / rate;
                at_low = j;
            } else if (rate < 0.0 && need / rate < high) {
                high = need / rate;
                at_high = j;
            }
        }
        if (low > high + CONFLICT * (scale + fabs(low))) {
            wanted = slack_of_conflict(rows, worst, at_low, at_high);
            return (Projection){false, p_1, p_2, at_low, at_high, wanted};
        }
        double t = 0.0;
        second = -1;
        if (t < low) {
            t = low;
            second = at_low;
        } else if (t > high) {
            t = high;
            second = at_high;
        }
        p_1 = foot_1 - t * n_2;
        p_2 = foot_2 + t * n_1;
        first = worst;
        rows.at[count * rows.columns + CHOSEN] = worst;
    }
    return (Projection){true, p_1, p_2, first, second, 0.0};
}

/* qpavoid.qp.exact: Return the least s ≥ ``wanted`` at which the half-planes have a
 * common point. */
static double least_slack(matrix rows, double wanted, double z_1, double z_2)
{
    if (!(wanted < INFINITY)) {
        return INFINITY;
    }
    double slack = max2(wanted, LEAST_SLACK);
    double allowance = ALLOWANCE;
    for (int turn_1 = 0; turn_1 < ROUNDS; turn_1++) {
        const Projection nearest = nearest_point(rows, z_1, z_2, slack + allowance);
        if (nearest.found) {
            return slack;
        }
        if (!(nearest.wanted < INFINITY)) {
            break;
        }
        slack = max2(nearest.wanted, slack + allowance);
        allowance = allowance * 2.0;
    }
    return INFINITY;
}

/* qpavoid.qp.exact: Return by how much rows are lowered, m/s, if they need ``slack``: a
 * little more. */
static double relaxation(double slack, double tolerance)
{
    if (slack == 0.0) {
        return 0.0;
    }
    return slack + min2(max2(slack, LEAST_MORE), tolerance);
}

/* qpavoid.qp.exact: Return the twist nearest to the desired one that keeps every row
 * and limit. */
static Optimum solve_exactly(matrix rows, const Terms *restrict terms, double
    slack_tolerance)
{
    const double least = half_planes(rows, terms);
    const Box box = terms->box;
    double slack = 0.0;
    const double scale_v = sqrt(terms->weights._0);
    const double scale_omega = sqrt(terms->weights._1);
    const double z_1 = terms->desired._0 * scale_v;
    const double z_2 = terms->desired._1 * scale_omega;
    Projection p = nearest_point(rows, z_1, z_2, 0.0);
    if (least > 0.0 || !p.found) {
        slack = least_slack(rows, max2(least, p.wanted), z_1, z_2);
        if (!(slack < INFINITY)) {
            return (Optimum){false, 0.0, 0.0, slack, -1, -1};
        }
        p = nearest_point(rows, z_1, z_2, relaxation(slack, slack_tolerance));
    }
    const double v = min2(max2(p.z_1 / scale_v, box.v_min), box.v_max);
    const double omega = min2(max2(p.z_2 / scale_omega, box.omega_min), box.omega_max);
    return (Optimum){p.found, v, omega, slack, p.first, p.second};
}

/* qpavoid.avoidance.step: Return whether two twists count as the same. */
static bool is_near(tuple_dd one, tuple_dd other)
{
    const double d_v = fabs(one._0 - other._0);
    const double d_omega = fabs(one._1 - other._1);
    return d_v <= UNCHANGED && d_omega <= UNCHANGED;
}

/* qpavoid.avoidance.judge: Return the stopping distance after one control step of a
 * twist, m. */
static double way_to_rest(const Scene *restrict scene, tuple_dd twist)
{
    const double n = braking_steps(scene->robot, twist._0, twist._1, scene->settings->dt);
    return 0.5 * fabs(twist._0) * scene->longest * (n + 1.0);
}

/* qpavoid.avoidance.judge: Return how fast a robot whose velocities ramp leaves the arc
 * as it brakes, m/s. */
static double drift_of(const Scene *restrict scene, tuple_dd twist)
{
    const filter_settings s = scene->settings;
    const vector robot_ = scene->robot;
    const double v = twist._0;
    const double omega = twist._1;
    if ((int)s->ramps == 0) {
        return 0.0;
    }
    const double n = braking_steps(robot_, v, omega, s->dt);
    const double way = way_to_rest(scene, twist);
    const double d_v = max2(fabs(v - scene->last._0), fabs(v) / n);
    const double d_omega = max2(fabs(omega - scene->last._1), fabs(omega) / n);
    return d_v + d_omega * (limits_of(robot_).circumradius + way);
}

/* qpavoid.avoidance.judge: Return whether one control step of a twist, then braking,
 * keeps clear of statics. */
static bool may_brake(const Scene *restrict scene, tuple_dd twist)
{
    const filter_settings s = scene->settings;
    const double drift = drift_of(scene, twist);
    const double far = scene->pending._0;
    const double turned = scene->pending._1;
    const Scene braced = altered(scene, scene->bodies, drift, scene->closest);
    const double reach = limits_of(scene->robot).circumradius + way_to_rest(scene,
        twist);
    const double off = (scene->longest - s->dt) * (far + turned * reach);
    const Rollout rollout = rollout_to_rest(&braced, twist);
    return keeps_from_standing(&braced, &rollout, lowest(scene) + off);
}

/* qpavoid.avoidance.judge: Return whether a plan that begins with a twist keeps clear.
 * */
static bool keeps_clear(const Scene *restrict scene, const Plan *restrict plan, tuple_dd
    twist, double until)
{
    const Rollout rollout = exact_rollout(scene, plan, twist);
    const double level = lowest(scene);
    return keeps_all(scene, &rollout, (const Watch[]){(Watch){(tuple_dd){until, level},
        (tuple_dd){rollout.rest, level}}});
}

/* qpavoid.avoidance.judge: Return for how long (s) a target may be held so that the
 * plan keeps clear. */
static double clear_end(const Scene *restrict scene, tuple_dd target, tuple_dd twist,
    double least)
{
    const filter_settings s = scene->settings;
    if (is_inexact(scene) && !may_brake(scene, twist)) {
        return 0.0;
    }
    const double among_2[] = {INFINITY, 1.0, 0.4, 0.0};
    for (int turn_1 = 0; turn_1 < 4; turn_1++) {
        const double lasts = among_2[turn_1];
        const double end = max2(min2(lasts, s->horizon), s->dt);
        if (end < least) {
            break;
        }
        const Plan plan = hold(target._0, target._1, end);
        if (keeps_clear(scene, &plan, twist, s->horizon)) {
            return end;
        }
    }
    return 0.0;
}

/* qpavoid.avoidance.ladder: Return the plan of a twist that may be driven; that of 0 s:
 * it may not. */
static Plan judged(const Scene *restrict scene, const Prepared *restrict prepared,
    tuple_dd twist)
{
    const filter_settings s = scene->settings;
    const double new_1 = scene->settings->dt;
    double v = twist._0;
    double omega = twist._1;
    double end = new_1;
    if ((int)s->bound == BARRIER && (int)s->braking_room) {
        const Target target = prepared->target;
        if (prepared->ahead && (twist._0 == prepared->anchor._0 && twist._1 ==
            prepared->anchor._1) && target.mode <= ROUND) {
            v = target.plan.v;
            omega = target.plan.omega;
            end = target.plan.end;
        } else if (prepared->ahead) {
            v = v + prepared->rest._0;
            omega = omega + prepared->rest._1;
            double least = 0.0;
            if (target.mode == ROUND && !is_rest(&target.plan)) {
                least = min2(target.plan.end, 1.0);
            }
            end = clear_end(scene, (tuple_dd){v, omega}, twist, least);
        } else if (!may_brake(scene, twist)) {
            end = 0.0;
        }
        if (end > 0.0 && !leaves_contact(scene, prepared, twist, 0.0)) {
            end = 0.0;
        }
    }
    return hold(v, omega, end);
}

/* qpavoid.avoidance.step: Return the obstacles of the rows that hold an answer, and of
 * the target; −1. */
static tuple_ii holders(matrix rows, const Prepared *restrict prepared, int one, int
    other)
{
    const int m = prepared->m;
    const int first = 0 <= one && one < m ? whole(rows.at[one * rows.columns +
        STEP_OWNER]) : -1;
    int second = 0 <= other && other < m ? whole(rows.at[other * rows.columns +
        STEP_OWNER]) : -1;
    if (second < 0) {
        second = prepared->target.owner;
    }
    return first >= 0 ? (tuple_ii){first, second} : (tuple_ii){second, -1};
}

/* qpavoid.avoidance.step: Return the outcome of an attempt, or :data:`AGAIN` with the
 * twist rejected. */
static Outcome decide(const Setup *restrict setup, const Prepared *restrict prepared,
    vector memory, int attempt, tuple_dd rejected, tuple_dd answer, vector state)
{
    const filter_settings s = setup->settings;
    const Workspace space = carve(memory, prepared->most, setup->settings);
    const Scene scene = new_scene(setup, state, &space, prepared->bodies);
    if (attempt >= attempts(prepared)) {
        return fall_back(&scene, prepared, (const Outcome[]){unsolved(AGAIN, rejected,
            0.0)}, state);
    }
    const matrix rows = band(space.rows, 0, prepared->m + 4);
    const int n_hard = prepared->n_hard;
    const tuple_dd desired = prepared->desired;
    const Box box = trust_box(prepared, attempt, rejected);
    const tuple_dd weights = (tuple_dd){s->weight_v, s->weight_omega};
    const Terms terms = (Terms){box, desired, weights, n_hard};
    const Optimum solved = solve_exactly(rows, &terms, s->slack_tolerance);
    tuple_dd twist = (tuple_dd){solved.v, solved.omega};
    const double slack = solved.slack;
    if (!(isinf(answer._0) || isinf(answer._1))) {
        twist = answer;
    }
    const double relaxed = relaxation(slack, s->slack_tolerance);
    const tuple_dd certificate_1 = certificate(rows, &terms, relaxed, twist);
    const double violation = certificate_1._0;
    const double gap = certificate_1._1;
    const double residual = max2(violation, gap);
    if (!(solved.found && residual <= RESIDUAL_TOLERANCE)) {
        const Outcome failed = unsolved(STOPPED, prepared->anchor, residual);
        return fall_back(&scene, prepared, &failed, state);
    }
    if (is_near(twist, prepared->anchor)) {
        twist = prepared->anchor;
    }
    if (is_near(twist, prepared->wish)) {
        twist = prepared->wish;
    }
    const Plan plan = judged(&scene, prepared, twist);
    if (plan.end == 0.0) {
        return unsolved(AGAIN, attempt == 0 ? twist : rejected, 0.0);
    }
    int code = twist._0 == prepared->wish._0 && twist._1 == prepared->wish._1 ? TRACKING :
        FILTERED;
    if (slack > 0.0) {
        code = RELAXED;
    }
    keep_plan(state, twist, &plan, s->horizon, s->dt);
    const tuple_ii holders_2 = holders(rows, prepared, solved.first, solved.second);
    const int first = holders_2._0;
    const int second = holders_2._1;
    const double v = twist._0;
    const double omega = twist._1;
    const double clearance = prepared->clearance;
    return (Outcome){code, v, omega, clearance, slack, residual, 0.0, first, second};
}

/* qpavoid.model.kinematics: Return the angle in (−π, π] that differs from ``angle`` by
 * whole turns. */
static double wrap_angle(double angle)
{
    return angle - 2.0 * 3.141592653589793 * ceil((angle - 3.141592653589793) / (2.0 *
        3.141592653589793));
}

/* qpavoid.tracking.kanayama: Return e = R(γ)ᵀ(x_r − x) in m, robot frame, and e_γ in
 * (−π, π] rad. */
static tuple_ddd tracking_error(const tuple_ddd *restrict pose, const tuple_ddd
    *restrict target)
{
    const double cos_ = cos(pose->_2);
    const double sin_ = sin(pose->_2);
    const double d_x = target->_0 - pose->_0;
    const double d_y = target->_1 - pose->_1;
    const double e_heading = wrap_angle(target->_2 - pose->_2);
    return (tuple_ddd){cos_ * d_x + sin_ * d_y, cos_ * d_y - sin_ * d_x, e_heading};
}

/* qpavoid.guide.state: Put the mark where the robot is. */
static void set_mark(vector state)
{
    state.at[MARK] = 0.0;
    state.at[MARK + 1] = 0.0;
    state.at[MARK + 2] = 0.0;
}

/* qpavoid.guide.state: Bring clocks and poses up to date after a step in which a twist
 * was driven. */
static void note_motion(vector state, double progress, tuple_dd driven, double dt)
{
    const tuple_ddd pose = arc(0.0, 0.0, 0.0, driven._0, driven._1, dt);
    const int among_2[] = {MARK, LEAD};
    for (int turn_1 = 0; turn_1 < 2; turn_1++) {
        const int k = among_2[turn_1];
        const tuple_ddd known = (tuple_ddd){state.at[k], state.at[k + 1], state.at[k +
            2]};
        const tuple_ddd tracking_error_3 = tracking_error(&pose, &known);
        state.at[k] = tracking_error_3._0;
        state.at[k + 1] = tracking_error_3._1;
        state.at[k + 2] = tracking_error_3._2;
    }
    state.at[STILL] = state.at[STILL] + dt;
    state.at[LOOKED] = state.at[LOOKED] + dt;
    state.at[BEGUN] = state.at[BEGUN] + dt;
    const bool far = square(state.at[MARK]) + square(state.at[MARK + 1]) >
        square(progress);
    if (far || (state.at[MODE] == DETOUR && fabs(state.at[MARK + 2]) > TURNED)) {
        state.at[STILL] = 0.0;
        set_mark(state);
    }
}

/* qpavoid.guide.state: Go back to tracking, with the clock at zero and the mark here.
 * */
static void clear(vector state)
{
    state.at[MODE] = CLEAR;
    state.at[STILL] = 0.0;
    set_mark(state);
}

/* qpavoid.guide.stage: Return the scene of a step among some bodies, without memory for
 * rollouts. */
static Scene scene_of(const Stage *restrict stage, matrix bodies, const Tracking
    *restrict tracking)
{
    const matrix new_1 = band(bodies, 0, 0);
    const matrix edges_ = stage->setup.edges;
    const vector robot_ = stage->setup.robot;
    const filter_settings settings_ = stage->setup.settings;
    const matrix none = new_1;
    return (Scene){edges_, robot_, settings_, bodies, tracking->driven, (tuple_dd){0.0,
        0.0}, none, none, tracking->dt, 0.0, INFINITY};
}

/* qpavoid.avoidance.scene: Return the box of the twists that the look-ahead may aim at.
 * */
static Box look_box(vector robot_)
{
    const RobotLimits limits = limits_of(robot_);
    return (Box){max2(limits.v_min, -UNLIMITED_TWIST), min2(limits.v_max,
        UNLIMITED_TWIST), max2(limits.omega_min, -UNLIMITED_TWIST),
        min2(limits.omega_max, UNLIMITED_TWIST)};
}

/* qpavoid.model.robot: Return τ(u) in s: driving (v, ω) so long leads to where braking
 * would end. */
static double stopping_time(vector robot_, double v, double omega, double dt)
{
    return 0.5 * dt * (braking_steps(robot_, v, omega, dt) + 1.0);
}

/* qpavoid.avoidance.settings: Return the curve of a record of settings, of the filter
 * or of the guide. */
static RadiusCurve radius_curve(filter_settings settings_)
{
    const filter_settings s = settings_;
    return (RadiusCurve){s->r_min_slow, s->r_min_fast, s->speed_low, s->speed_high};
}

/* qpavoid.avoidance.settings: Return r_min for an obstacle's speed in m/s, in m: linear
 * between two speeds. */
static double safety_radius(double speed, const RadiusCurve *restrict curve)
{
    const RadiusCurve c = (*curve);
    if (speed <= c.speed_low) {
        return c.r_min_slow;
    }
    if (speed >= c.speed_high) {
        return c.r_min_fast;
    }
    const double rise = (c.r_min_fast - c.r_min_slow) * (speed - c.speed_low);
    return c.r_min_slow + rise / (c.speed_high - c.speed_low);
}

/* qpavoid.avoidance.settings: Return by how much an obstacle is widened, m; see
 * :class:`Margins`. */
static double widening(double speed, double age, double error, double acceleration,
    double dt)
{
    const double strayed = 0.5 * acceleration * dt * dt;
    return error + age * (speed + acceleration * age) + strayed;
}

/* qpavoid.avoidance.barrier_rows: Return r_min(v_o), and the same with the widening of
 * the margins, in m. */
static tuple_dd wanted_distance(filter_settings settings_, double speed, double age)
{
    const filter_settings s = settings_;
    const double r_min = safety_radius(speed, (const
        RadiusCurve[]){radius_curve(settings_)});
    const double wider = widening(speed, age, s->error, s->obstacle_acceleration,
        s->dt);
    return (tuple_dd){r_min, r_min + wider};
}

/* qpavoid.avoidance.bodies: Return by how much r_min grows as robot and obstacle close
 * in, m. */
static double closing_margin(const Scene *restrict scene, tuple_dd place, tuple_dd
    velocity)
{
    const double closing = scene->settings->closing_gain;
    const double x = place._0;
    const double y = place._1;
    const double v_x = velocity._0;
    const double v_y = velocity._1;
    if (closing == 0.0) {
        return 0.0;
    }
    const double apart = max2(sqrt(x * x + y * y), TINY);
    return closing * max2(((scene->last._0 - v_x) * x - v_y * y) / apart, 0.0);
}

/* qpavoid.avoidance.bodies: Return a point that stands, and from which ``low`` m are to
 * be kept. */
static Body point_body(const Scene *restrict scene, tuple_dd place, double low, int
    owner)
{
    const double new_1 = low;
    const double new_2 = low - scene->settings->r_min_slow;
    const double x = place._0;
    const double y = place._1;
    double keep = new_1;
    const double margin = new_2;
    const double z = 0.0;
    if (scene->settings->closing_gain > 0.0) {
        keep = keep + closing_margin(scene, place, (tuple_dd){0.0, 0.0});
    }
    return (Body){x, y, z, z, z, z, z, z, z, keep, margin, keep, z, z, STANDS,
        (double)owner, INFINITY, -1.0};
}

/* qpavoid.avoidance.body_table: Return the signed distance of the footprint from the
 * line of a body now, m. */
static double line_distance(matrix edges_, const Body *restrict body)
{
    const double x = body->x;
    const double y = body->y;
    if (is_point(body)) {
        return point_contact(edges_, x, y).distance;
    }
    const Segment wall = (Segment){x + body->x1, y + body->y1, x + body->x2, y + body->y2};
    return wall_contact(edges_, &wall).distance;
}

/* qpavoid.avoidance.bodies: Cap the distance to keep from a static body at the present
 * one plus ε. */
static Body keep_at_most(const Scene *restrict scene, const Body *restrict body)
{
    const double far = limits_of(scene->robot).circumradius + body->spread;
    const Body b = (*body);
    if (b.kind == MOVES || square(b.x) + square(b.y) >= far * far) {
        return (*body);
    }
    const double distance = line_distance(scene->edges, body);
    double growth = b.growth;
    double missing = b.keep - distance - tolerance(scene);
    if (missing > 0.0) {
        growth = 0.0;
    }
    missing = max2(missing, 0.0);
    const double keep = b.keep - missing;
    const double spread = b.spread - missing;
    return (Body){b.x, b.y, b.x1, b.y1, b.x2, b.y2, b.v_x, b.v_y, b.turn, keep,
        b.inflation, spread, b.speed, growth, b.kind, b.owner, distance - keep,
        b.group};
}

/* qpavoid.avoidance.body_table: Write row i of the table. */
static void set_body(matrix bodies, int i, const Body *restrict body)
{
    const vector b = row_of(bodies, i);
    b.at[0] = body->x;
    b.at[1] = body->y;
    b.at[2] = body->x1;
    b.at[3] = body->y1;
    b.at[4] = body->x2;
    b.at[5] = body->y2;
    b.at[6] = body->v_x;
    b.at[7] = body->v_y;
    b.at[8] = body->turn;
    b.at[9] = body->keep;
    b.at[10] = body->inflation;
    b.at[11] = body->spread;
    b.at[12] = body->speed;
    b.at[13] = body->growth;
    b.at[14] = body->kind;
    b.at[15] = body->owner;
    b.at[16] = body->now;
    b.at[17] = body->group;
}

/* qpavoid.model.capsules: Return the way from the nearest point of a segment to (x, y),
 * m. */
static tuple_dd from_segment(const Segment *restrict axis, double x, double y)
{
    const double s_x = axis->x2 - axis->x1;
    const double s_y = axis->y2 - axis->y1;
    const double d_x = x - axis->x1;
    const double d_y = y - axis->y1;
    double share = (d_x * s_x + d_y * s_y) / max2(s_x * s_x + s_y * s_y, NO_SQUARE);
    share = min2(max2(share, 0.0), 1.0);
    return (tuple_dd){d_x - share * s_x, d_y - share * s_y};
}

/* qpavoid.avoidance.groups: Return the wall that has no more room than any of these
 * points. */
static Body group_of(const Scene *restrict scene, int begin, int end)
{
    const Body one = body_at(scene, begin);
    const Body other = body_at(scene, end - 1);
    const Segment axis = (Segment){one.x, one.y, other.x, other.y};
    double keep = 0.0;
    double r_min = INFINITY;
    const double z = 0.0;
    const int end_2 = end;
    for (int i = begin; i < end_2; i++) {
        const Body body = body_at(scene, i);
        const tuple_dd from_segment_3 = from_segment(&axis, body.x, body.y);
        const double d_x = from_segment_3._0;
        const double d_y = from_segment_3._1;
        keep = max2(keep, body.keep + sqrt(d_x * d_x + d_y * d_y) + TINY);
        r_min = min2(r_min, body.keep - body.inflation);
    }
    const double x = 0.5 * (one.x + other.x);
    const double y = 0.5 * (one.y + other.y);
    const double x1 = one.x - x;
    const double y1 = one.y - y;
    const double x2 = other.x - x;
    const double y2 = other.y - y;
    const double spread = keep + sqrt(max2(square(x1) + square(y1), square(x2) +
        square(y2)));
    return (Body){x, y, x1, y1, x2, y2, z, z, z, keep, keep - r_min, spread, z, z,
        STANDS, (double)end, INFINITY, -1.0};
}

/* qpavoid.avoidance.groups: Gather points given one after the other that lie together,
 * as those of a scan. */
static void group_points(const Scene *restrict scene, int count)
{
    const matrix bodies = scene->bodies;
    int begin = 0;
    int made = 0;
    const int end_2 = count + 1;
    for (int i = 1; i < end_2; i++) {
        const vector a = row_of(bodies, begin);
        const vector b = row_of(bodies, imin(i, count - 1));
        const double square_ = square(b.at[0] - a.at[0]) + square(b.at[1] - a.at[1]);
        const bool near = square_ < WIDE * WIDE * (square(a.at[0]) + square(a.at[1]));
        if (i < count && i - begin < MANY && near) {
            continue;
        }
        if (i - begin >= FEW && made < scene->groups.rows) {
            set_body(scene->groups, made, (const Body[]){group_of(scene, begin, i)});
            bodies.at[begin * bodies.columns + GROUP] = made;
            made = made + 1;
        }
        begin = i;
    }
}

/* qpavoid.model.capsules: Return a speed that no point of the axis of capsule i
 * exceeds, m/s. */
static double speed_bound(matrix capsules, int i)
{
    const double v_x = capsules.at[i * capsules.columns + V_X];
    const double v_y = capsules.at[i * capsules.columns + V_Y];
    const double speed = sqrt(v_x * v_x + v_y * v_y);
    const double turn = fabs(capsules.at[i * capsules.columns + TURN]);
    if (turn == 0.0) {
        return speed;
    }
    const double c_x = capsules.at[i * capsules.columns + PIVOT_X];
    const double c_y = capsules.at[i * capsules.columns + PIVOT_Y];
    const double d_x = capsules.at[i * capsules.columns + X1] - c_x;
    const double d_y = capsules.at[i * capsules.columns + Y1] - c_y;
    const double e_x = capsules.at[i * capsules.columns + X2] - c_x;
    const double e_y = capsules.at[i * capsules.columns + Y2] - c_y;
    const double far = max2(d_x * d_x + d_y * d_y, e_x * e_x + e_y * e_y);
    return speed + turn * sqrt(far);
}

/* qpavoid.avoidance.bodies: Return a capsule that stands, moves, or creeps, where the
 * horizon is 0. */
static Body capsule_body(const Scene *restrict scene, matrix capsules, int i, double
    age, double horizon)
{
    const vector c = row_of(capsules, i);
    double speed = speed_bound(capsules, i);
    double growth = 0.0;
    const double x = c.at[PIVOT_X];
    const double y = c.at[PIVOT_Y];
    double v_x = c.at[V_X];
    double v_y = c.at[V_Y];
    const tuple_dd wanted_distance_1 = wanted_distance(scene->settings, speed, age);
    const double r_min = wanted_distance_1._0;
    double keep = wanted_distance_1._1;
    keep = keep + (closing_margin(scene, (tuple_dd){x, y}, (tuple_dd){v_x, v_y}) +
        c.at[RADIUS]);
    double x1 = c.at[X1];
    double y1 = c.at[Y1];
    double x2 = c.at[X2];
    double y2 = c.at[Y2];
    const bool nearer = fabs(y2) < fabs(y1);
    const bool level = fabs(y2) == fabs(y1);
    if (x2 < x1 || (x2 == x1 && (nearer || (level && y2 < y1)))) {
        const double new_2 = y2;
        const double new_3 = x1;
        const double new_4 = y1;
        x1 = x2;
        y1 = new_2;
        x2 = new_3;
        y2 = new_4;
    }
    x1 = x1 - x;
    y1 = y1 - y;
    x2 = x2 - x;
    y2 = y2 - y;
    const double spread = keep + sqrt(max2(square(x1) + square(y1), square(x2) +
        square(y2)));
    double kind = MOVES;
    double turn = c.at[TURN];
    if (speed <= SPEED_AT_REST || horizon == 0.0) {
        const tuple_dd one_5 = speed <= SPEED_AT_REST ? (tuple_dd){STANDS, 0.0} :
            (tuple_dd){CREEPS, speed};
        kind = one_5._0;
        growth = one_5._1;
        v_x = 0.0;
        v_y = 0.0;
        turn = 0.0;
        speed = 0.0;
    }
    return (Body){x, y, x1, y1, x2, y2, v_x, v_y, turn, keep, keep - r_min, spread,
        speed, growth, kind, c.at[OWNER], INFINITY, -1.0};
}

/* qpavoid.avoidance.body_table: Return whether row i comes before row j by the first
 * number that differs. */
static bool comes_first(matrix bodies, int i, int j)
{
    for (int column = 0; column < BODY_TABLE_OWNER; column++) {
        if (bodies.at[i * bodies.columns + column] != bodies.at[j * bodies.columns +
            column]) {
            return bodies.at[i * bodies.columns + column] < bodies.at[j * bodies.columns
                + column];
        }
    }
    return false;
}

/* qpavoid.avoidance.body_table: Sort the rows, so that the order in which obstacles are
 * given decides nothing. */
static void sort_bodies(matrix bodies)
{
    const int same_1 = bodies.rows;
    int gap = same_1;
    const int count = same_1;
    while (gap > 1) {
        gap = imax(quotient(gap * 5, 11), 1);
        const int end_3 = count;
        for (int i = gap; i < end_3; i++) {
            int j = i - gap;
            while (j >= 0 && comes_first(bodies, j + gap, j)) {
                const int end_5 = bodies.columns;
                for (int column = 0; column < end_5; column++) {
                    const double kept = bodies.at[j * bodies.columns + column];
                    bodies.at[j * bodies.columns + column] = bodies.at[(j + gap) *
                        bodies.columns + column];
                    bodies.at[(j + gap) * bodies.columns + column] = kept;
                }
                j = j - gap;
            }
        }
    }
}

/* qpavoid.avoidance.bodies: Fill in the bodies within reach of any rollout; return how
 * many. */
static int bodies_in_reach(const Scene *restrict scene, const tuple_mm *restrict
    obstacles, double age, double horizon)
{
    Body body = {0};
    const vector robot_ = scene->robot;
    const filter_settings s = scene->settings;
    const double radius = limits_of(robot_).circumradius;
    const matrix points = obstacles->_0;
    const matrix capsules = obstacles->_1;
    const Box box = look_box(robot_);
    const matrix bodies = scene->bodies;
    const double fastest = max2(-box.v_min, box.v_max);
    const double turning = max2(-box.omega_min, box.omega_max);
    double stop = stopping_time(robot_, fastest, turning, s->dt) * scene->longest /
        s->dt;
    if ((int)s->ramps != 0) {
        stop = stop * 2.0;
    }
    const tuple_dd wanted_distance_1 = wanted_distance(scene->settings, 0.0, age);
    const double low = wanted_distance_1._1;
    const double still = radius + fastest * (horizon + stop);
    int count = 0;
    const int end_3 = points.rows;
    for (int i = 0; i < end_3; i++) {
        body = point_body(scene, (tuple_dd){points.at[i * points.columns + 0],
            points.at[i * points.columns + 1]}, low, i);
        if (body.x * body.x + body.y * body.y < square(body.keep + still)) {
            set_body(bodies, count, (const Body[]){keep_at_most(scene, &body)});
            count = count + 1;
        }
    }
    const int first = count;
    if (horizon > 0.0) {
        group_points(scene, count);
    }
    const int end_5 = capsules.rows;
    for (int i = 0; i < end_5; i++) {
        body = capsule_body(scene, capsules, i, age, horizon);
        const double apart = sqrt(body.x * body.x + body.y * body.y) - body.spread;
        bool near = apart < still;
        if (body.kind == MOVES) {
            near = apart < radius + (body.speed + fastest) * horizon;
        } else if (body.kind == CREEPS) {
            near = body.growth <= s->speed_low && apart < still + body.growth * stop;
        }
        if (near) {
            set_body(bodies, count, (const Body[]){keep_at_most(scene, &body)});
            count = count + 1;
        }
    }
    sort_bodies(band(bodies, first, count));
    return count;
}

/* qpavoid.avoidance.body_table: Return whether any body in reach moves. */
static bool any_moves(const Scene *restrict scene)
{
    const int end_2 = scene->bodies.rows;
    for (int i = 0; i < end_2; i++) {
        if (moves(scene, i)) {
            return true;
        }
    }
    return false;
}

/* qpavoid.guide.choice: Choose to stand for a tick. */
static void stand_still(vector chosen)
{
    chosen.at[CHOICE_KIND] = HOLD;
    chosen.at[A] = 0.0;
    chosen.at[B] = 0.0;
    chosen.at[LEFT] = 1.0;
}

/* qpavoid.guide.choice: Return whether the reference ahead comes to its end. */
static bool ends(const Course *restrict course)
{
    return course->ahead.at[(course->ahead.rows - 1) * course->ahead.columns + CHOICE_V] <
        SLOW;
}

/* qpavoid.guide.choice: Return whether the reference is at its end, and not about to
 * begin. */
static bool has_come(const Course *restrict course)
{
    const vector begin = row_of(course->ahead, 0);
    const vector end = row_of(course->ahead, course->ahead.rows - 1);
    const double way = sqrt(square(end.at[X] - begin.at[X]) + square(end.at[Y] -
        begin.at[Y]));
    return begin.at[CHOICE_V] < SLOW && way < LEFT_TO_GO;
}

/* qpavoid.guide.choice: Return the candidate that is remembered. */
static Candidate driven_candidate(vector chosen)
{
    return (Candidate){chosen.at[CHOICE_KIND], chosen.at[A], chosen.at[B],
        chosen.at[LEFT]};
}

/* qpavoid.guide.choice: Return a candidate of the list. */
static Candidate listed(double fastest, int number)
{
    if (number == 0) {
        return (Candidate){PARK, 0.0, 0.0, 0.0};
    }
    if (number == 1) {
        return (Candidate){TRACK, 0.0, 1.0, 0.0};
    }
    if (number == STANDING) {
        return (Candidate){HOLD, 0.0, 0.0, 61.0};
    }
    int i = number - FIRST;
    if (i < FOLLOWS) {
        return (Candidate){FOLLOW, ((const double[]){0.0, -0.35, 0.35, -0.7, 0.7, -1.1,
            1.1, -1.6, 1.6, -2.2, 2.2})[quotient(i, 4)], ((const double[]){1.0, 0.7,
            0.4, 0.15})[modulo(i, 4)], 0.0};
    }
    i = i - FOLLOWS;
    const int each = 3 * 3;
    const int ticks = 3;
    const double v = ((const double[]){0.0, -0.4, 0.45, 0.9})[quotient(i, each)];
    i = modulo(i, each);
    return (Candidate){HOLD, v * fastest, ((const double[]){0.0, -1.0, 1.0})[quotient(i,
        ticks)], ((const double[]){5.0, 10.0, 20.0})[modulo(i, ticks)]};
}

/* qpavoid.guide.rollout: Return the least room of all bodies for a robot at a pose at a
 * time, m. */
static double room_at_pose(const Scene *restrict scene, const Frame *restrict at, double
    time, double enough)
{
    double least = enough;
    const double radius = limits_of(scene->robot).circumradius;
    const int end_2 = scene->bodies.rows;
    for (int i = 0; i < end_2; i++) {
        const Body body = body_at(scene, i);
        const double d_x = body.x + time * body.v_x - at->x;
        const double d_y = body.y + time * body.v_y - at->y;
        const double far = radius + body.spread + least;
        if (far > 0.0 && d_x * d_x + d_y * d_y < far * far) {
            const Contact contact = line_contact(scene->edges, &body, (const
                Ends[]){ends_at(&body, time, at)});
            least = min2(least, contact.distance - body.keep);
        }
    }
    return least;
}

/* qpavoid.guide.rollout: Return a row of the reference ahead. */
static Reference reference_at(matrix ahead, int row)
{
    const vector r = row_of(ahead, row);
    return (Reference){r.at[X], r.at[Y], r.at[HEADING], r.at[ROLLOUT_V],
        r.at[ROLLOUT_OMEGA]};
}

/* qpavoid.guide.steering: Return the twist towards a pose at rest: turn to it, drive
 * there, turn. */
static tuple_dd park_twist(vector robot_, const tuple_ddd *restrict goal)
{
    const RobotLimits new_1 = limits_of(robot_);
    const double x = goal->_0;
    const double y = goal->_1;
    double turn = goal->_2;
    const RobotLimits limits = new_1;
    const double way = sqrt(x * x + y * y);
    const double most = min2(limits.omega_max, MOST);
    double ahead = 1.0;
    if (way < AT) {
        turn = wrap_angle(turn);
        if (fabs(turn) < AT) {
            return (tuple_dd){0.0, 0.0};
        }
        return (tuple_dd){0.0, min2(max2(TURN_IN * turn, -most), most)};
    }
    double bearing = atan2(y, x);
    const double behind = wrap_angle(bearing + 3.141592653589793);
    const double turns = fabs(bearing) + fabs(wrap_angle(turn - bearing));
    const double back = fabs(behind) + fabs(wrap_angle(turn - behind));
    if (limits.v_min < 0.0 && back < turns - SAME_TURNS) {
        bearing = behind;
        ahead = -1.0;
    }
    const double omega = min2(max2(TURN_IN * bearing, -most), most);
    if (fabs(bearing) > ASIDE) {
        return (tuple_dd){0.0, omega};
    }
    const double fastest = min2(ahead > 0.0 ? limits.v_max : -limits.v_min, MOST);
    const double v = min2(min2(CLOSE * way, sqrt(limits.acceleration * way)), fastest);
    return (tuple_dd){ahead * v * (1.0 - fabs(bearing) / ASIDE), omega};
}

/* qpavoid.guide.rollout: Return the twist that parks a robot at the end of the
 * reference. */
static tuple_dd parking(const Course *restrict course, const tuple_ddd *restrict pose)
{
    const Reference reference_at_1 = reference_at(course->ahead, course->ahead.rows - 1);
    const double x = reference_at_1.x;
    const double y = reference_at_1.y;
    const double heading = reference_at_1.heading;
    return park_twist(course->scene.robot, (const tuple_ddd[]){tracking_error(pose,
        (const tuple_ddd[]){(tuple_ddd){x, y, heading}})});
}

/* qpavoid.guide.rollout: Return in how many ticks a robot has parked that first holds a
 * twist, if sooner. */
static int arrival(const Course *restrict course, const Candidate *restrict candidate,
    int soonest)
{
    const Scene scene = course->scene;
    const guide_settings s = course->settings;
    Frame at = (Frame){0.0, 0.0, 1.0, 0.0};
    double heading = 0.0;
    tuple_dd twist = scene.last;
    int stayed = 0;
    const double level = min2(s->clear, room_at_pose(&scene, &at, 0.0, s->clear) -
        GRAZE);
    const int end_2 = soonest + STAY;
    for (int k = 0; k < end_2; k++) {
        tuple_dd target = (tuple_dd){candidate->a, candidate->b};
        if (k >= candidate->held) {
            target = parking(course, (const tuple_ddd[]){(tuple_ddd){at.x, at.y,
                heading}});
            if (target._0 == 0.0 && target._1 == 0.0) {
                stayed = stayed + 1;
                if (stayed == STAY) {
                    return k + 1 - STAY;
                }
            }
        }
        if (stayed == 0 && k >= soonest) {
            break;
        }
        twist = limit_twist(scene.robot, target, twist, TICK);
        at = moved_on(&at, twist._0, twist._1, TICK);
        heading = heading + twist._1 * TICK;
        if (room_at_pose(&scene, &at, TICK * (k + 1), s->clear) < level) {
            break;
        }
    }
    return soonest;
}

/* qpavoid.guide.choice: Return what parks soonest, at once or after holding a twist; or
 * :data:`NONE`. */
static Candidate soonest_parked(const Course *restrict course, vector chosen)
{
    int found = 0;
    const double fastest = min2(limits_of(course->scene.robot).v_max, MOST);
    Candidate best = (Candidate){-1.0, 0.0, 0.0, 0.0};
    int soonest = LATEST;
    const Candidate kept = driven_candidate(chosen);
    const Candidate among_2[] = {kept, listed(fastest, 0)};
    for (int turn_1 = 0; turn_1 < 2; turn_1++) {
        const Candidate first = among_2[turn_1];
        if (first.kind == PARK || first.kind == HOLD) {
            found = arrival(course, &first, soonest);
            if (found < soonest) {
                best = first;
                soonest = imax(found - SOONER, 0);
            }
        }
    }
    const int end_4 = FIRST + FOLLOWS + HOLDS;
    for (int number = FIRST + FOLLOWS; number < end_4; number++) {
        const Candidate candidate = listed(fastest, number);
        found = arrival(course, &candidate, soonest);
        if (found < soonest) {
            best = candidate;
            soonest = found;
        }
    }
    return best;
}

/* qpavoid.guide.steering: Return the row nearest to a place, from one on as long as
 * they come nearer. */
static int nearest_row(matrix ahead, int row, const Frame *restrict at)
{
    double least = square(ahead.at[row * ahead.columns + X] - at->x) +
        square(ahead.at[row * ahead.columns + Y] - at->y);
    while (row + 1 < ahead.rows) {
        const double away = square(ahead.at[(row + 1) * ahead.columns + X] - at->x) +
            square(ahead.at[(row + 1) * ahead.columns + Y] - at->y);
        if (away > least) {
            break;
        }
        row = row + 1;
        least = away;
    }
    return row;
}

/* qpavoid.guide.steering: Return the place a way further on than a row, beside it;
 * straight on at last. */
static tuple_dd point_ahead(matrix ahead, int row, double way, double offset)
{
    const int last = ahead.rows - 1;
    while (row < last && way > 0.0) {
        const double d_x = ahead.at[(row + 1) * ahead.columns + X] - ahead.at[row *
            ahead.columns + X];
        const double d_y = ahead.at[(row + 1) * ahead.columns + Y] - ahead.at[row *
            ahead.columns + Y];
        way = way - sqrt(d_x * d_x + d_y * d_y);
        row = row + 1;
    }
    const double cos_ = cos(ahead.at[row * ahead.columns + HEADING]);
    const double sin_ = sin(ahead.at[row * ahead.columns + HEADING]);
    way = max2(way, 0.0);
    return (tuple_dd){ahead.at[row * ahead.columns + X] + way * cos_ - offset * sin_,
        ahead.at[row * ahead.columns + Y] + way * sin_ + offset * cos_};
}

/* qpavoid.guide.steering: Return the twist that follows the reference at an offset. */
static tuple_dd follow_twist(vector robot_, matrix ahead, const Frame *restrict at, int
    row, double place, double offset)
{
    const RobotLimits limits = limits_of(robot_);
    const int t = imin(whole(place), ahead.rows - 2);
    const double share = min2(place - t, 1.0);
    const double cos_ = cos(ahead.at[t * ahead.columns + HEADING]);
    const double sin_ = sin(ahead.at[t * ahead.columns + HEADING]);
    double lag = (ahead.at[t * ahead.columns + X] - at->x) * cos_ + (ahead.at[t *
        ahead.columns + Y] - at->y) * sin_;
    double d_x = ahead.at[(t + 1) * ahead.columns + X] - ahead.at[t * ahead.columns +
        X];
    double d_y = ahead.at[(t + 1) * ahead.columns + Y] - ahead.at[t * ahead.columns +
        Y];
    lag = lag + share * (d_x * cos_ + d_y * sin_);
    double v = min2(max2(ahead.at[t * ahead.columns + STEERING_V] + CATCH_UP * lag,
        0.0), min2(limits.v_max, MOST));
    const tuple_dd point_ahead_1 = point_ahead(ahead, row, LOOK + LOOK_TIME * v,
        offset);
    const double x = point_ahead_1._0;
    const double y = point_ahead_1._1;
    d_x = x - at->x;
    d_y = y - at->y;
    const double along = at->cos * d_x + at->sin * d_y;
    const double aside = at->cos * d_y - at->sin * d_x;
    const double angle = atan2(aside, along);
    const double most = min2(limits.omega_max, MOST);
    if (fabs(angle) > TURN_ON_SPOT) {
        return (tuple_dd){0.0, copysign(most, angle)};
    }
    v = v * (1.0 - fabs(angle) / TURN_ON_SPOT);
    const double away = sqrt(d_x * d_x + d_y * d_y);
    const double omega = 2.0 * v * sin(angle) / max2(away, 0.2) + angle * min2(1.0, 5.0
        * v);
    return (tuple_dd){v, min2(max2(omega, -most), most)};
}

/* qpavoid.tracking.station: Return the law that :attr:`StationTracker.array` holds. */
static TrackingLaw law_of(vector law)
{
    const tuple_ddd moving = (tuple_ddd){law.at[0], law.at[1], law.at[2]};
    const tuple_ddd resting = (tuple_ddd){law.at[3], law.at[4], law.at[5]};
    return (TrackingLaw){moving, resting, law.at[6], law.at[7], law.at[8]};
}

/* qpavoid.tracking.kanayama: Return v_f of Eq. 6, m/s and rad/s, for gains k_x, k_y,
 * k_γ. */
static tuple_dd kanayama(const tuple_ddd *restrict error, tuple_dd reference, const
    tuple_ddd *restrict gains)
{
    const double e_x = error->_0;
    const double e_y = error->_1;
    const double e_gamma = error->_2;
    const double v_r = reference._0;
    const double omega_r = reference._1;
    const double k_x = gains->_0;
    const double k_y = gains->_1;
    const double k_gamma = gains->_2;
    return (tuple_dd){v_r * cos(e_gamma) + k_x * e_x, omega_r + v_r * k_y * e_y +
        k_gamma * sin(e_gamma)};
}

/* qpavoid.tracking.station: Return (v, ω) towards a pose, unlimited, and the mode to go
 * on with. */
static tuple_ddi station_command(const tuple_ddd *restrict error, const tuple_ddd
    *restrict gains, double near, bool reverse, int mode)
{
    const double e_x = error->_0;
    const double e_y = error->_1;
    const double e_gamma = error->_2;
    const double k_rho = gains->_0;
    const double k_alpha = gains->_1;
    const double k_theta = gains->_2;
    const double rho = sqrt(e_x * e_x + e_y * e_y);
    if (rho < near) {
        return (tuple_ddi){0.0, k_alpha * e_gamma, RESTING};
    }
    double alpha = atan2(e_y, e_x);
    double theta = wrap_angle(alpha - e_gamma);
    const double alpha_back = wrap_angle(alpha + 3.141592653589793);
    const double theta_back = wrap_angle(theta + 3.141592653589793);
    const double better_back = fabs(alpha) + fabs(theta) - fabs(alpha_back) -
        fabs(theta_back);
    if (!reverse) {
        mode = FORWARDS;
    } else if (mode == RESTING) {
        mode = better_back > 0.0 ? BACKWARDS : FORWARDS;
    } else if (better_back * mode > RELUCTANCE) {
        mode = -mode;
    }
    if (mode == BACKWARDS) {
        alpha = alpha_back;
        theta = theta_back;
    }
    const double sinc = fabs(alpha) > AHEAD ? sin(alpha) / alpha : 1.0;
    const double cos_ = reverse ? cos(alpha) : max2(cos(alpha), 0.0);
    const double omega = k_alpha * alpha + k_rho * cos_ * sinc * (alpha + k_theta *
        theta);
    return (tuple_ddi){mode * k_rho * rho * cos_, omega, mode};
}

/* qpavoid.tracking.station: Return the twist scaled into the limits; its curvature
 * stays. */
static tuple_dd within_limits(double v, double omega, const RobotLimits *restrict
    limits)
{
    double scale = 1.0;
    double bound = v > 0.0 ? limits->v_max : -limits->v_min;
    if (fabs(v) > bound) {
        scale = bound / fabs(v);
    }
    bound = omega > 0.0 ? limits->omega_max : -limits->omega_min;
    if (fabs(omega) * scale > bound) {
        scale = bound / fabs(omega);
    }
    return (tuple_dd){scale * v, scale * omega};
}

/* qpavoid.tracking.station: Return the desired (v, ω) of one control step, and the mode
 * to go on with. */
static tuple_ddi track_step(vector law, vector robot_, const tuple_ddd *restrict pose,
    const Reference *restrict reference, int mode)
{
    const RobotLimits limits = limits_of(robot_);
    const TrackingLaw record = law_of(law);
    const double x_r = reference->x;
    const double y_r = reference->y;
    const double heading_r = reference->heading;
    const double v_r = reference->v;
    const double omega_r = reference->omega;
    const tuple_ddd error = tracking_error(pose, (const tuple_ddd[]){(tuple_ddd){x_r,
        y_r, heading_r}});
    const tuple_dd kanayama_1 = kanayama(&error, (tuple_dd){v_r, omega_r},
        &record.moving);
    const double moving_v = kanayama_1._0;
    const double moving_omega = kanayama_1._1;
    if (fabs(v_r) >= record.blend_speed) {
        return (tuple_ddi){moving_v, moving_omega, RESTING};
    }
    const double near = mode == RESTING ? record.wake : record.rest;
    const bool reverse = limits.v_min < 0.0;
    const tuple_ddi station_command_2 = station_command(&error, &record.resting, near,
        reverse, mode);
    double v = station_command_2._0;
    double omega = station_command_2._1;
    mode = station_command_2._2;
    const tuple_dd within_limits_3 = within_limits(v, omega, &limits);
    v = within_limits_3._0;
    omega = within_limits_3._1;
    double share = fabs(v_r) / record.blend_speed;
    share = share * share * (3.0 - 2.0 * share);
    v = (1.0 - share) * v;
    omega = (1.0 - share) * omega;
    return (tuple_ddi){share * moving_v + v, share * moving_omega + omega, mode};
}

/* qpavoid.guide.rollout: Return the cost of a candidate; one dearer than ``limit`` not
 * to its end, m². */
static double roll_on(const Course *restrict course, const Candidate *restrict
    candidate, double limit)
{
    int j = 0;
    tuple_dd target = {0};
    const Scene scene = course->scene;
    const matrix ahead = course->ahead;
    const guide_settings s = course->settings;
    const vector robot_ = scene.robot;
    const int last = ahead.rows - 1;
    const int n = whole(rint(s->horizon / TICK));
    Frame at = (Frame){0.0, 0.0, 1.0, 0.0};
    double heading = 0.0;
    int row = 0;
    int mode = 0;
    tuple_dd twist = scene.last;
    double cost = 0.0;
    const double fastest = min2(limits_of(robot_).v_max, MOST);
    const int end_2 = n;
    for (int k = 0; k < end_2; k++) {
        if (candidate->kind == HOLD && k < candidate->held) {
            target = (tuple_dd){candidate->a, candidate->b};
        } else if (candidate->kind == FOLLOW) {
            row = nearest_row(ahead, row, &at);
            target = follow_twist(robot_, ahead, &at, row, candidate->b * (k + 1),
                candidate->a);
        } else if (candidate->kind == PARK) {
            target = parking(course, (const tuple_ddd[]){(tuple_ddd){at.x, at.y,
                heading}});
        } else {
            j = imin(k, last);
            const tuple_ddd pose = (tuple_ddd){at.x, at.y, heading};
            const Reference there = reference_at(ahead, j);
            const tuple_ddi track_step_3 = track_step(course->law, robot_, &pose, &there,
                mode);
            const double v = track_step_3._0;
            const double omega = track_step_3._1;
            mode = track_step_3._2;
            target = (tuple_dd){v, omega};
        }
        twist = limit_twist(robot_, target, twist, TICK);
        at = moved_on(&at, twist._0, twist._1, TICK);
        heading = heading + twist._1 * TICK;
        const double time = TICK * (k + 1);
        j = imin(k + 1, last);
        const double x = ahead.at[j * ahead.columns + X];
        const double y = ahead.at[j * ahead.columns + Y];
        const double share = min2(1.0, fastest * time / max2(sqrt(x * x + y * y),
            TINY));
        cost = cost + (square(at.x - share * x) + square(at.y - share * y));
        cost = cost + s->heading * (1.0 - cos(heading - ahead.at[j * ahead.columns +
            HEADING]));
        const double room = room_at_pose(&scene, &at, time, s->soft);
        cost = cost + s->near * square(s->soft - room);
        if (room < -GRAZE) {
            cost = cost + (s->deep * -room + s->enter * (n - k) / n);
            if (room < -DEEP) {
                return cost + LOST * (n - k);
            }
        }
        if (cost > limit) {
            break;
        }
    }
    return cost;
}

/* qpavoid.guide.choice: Return the factor of a candidate's cost for the side on which
 * it passes. */
static double side_share(const Candidate *restrict candidate, double side)
{
    const double aside = candidate->kind == HOLD ? candidate->b : candidate->a;
    return aside * side < 0.0 ? OTHER : 1.0;
}

/* qpavoid.guide.choice: Return the candidate that comes nearest to the reference. */
static Candidate cheapest(const Course *restrict course, vector chosen, bool waits)
{
    Candidate candidate = {0};
    double found = 0;
    double share = 0;
    const guide_settings s = course->settings;
    const double fastest = min2(limits_of(course->scene.robot).v_max, MOST);
    Candidate best = (Candidate){TRACK, 0.0, 1.0, 0.0};
    double cost = INFINITY;
    if (chosen.at[CHOICE_KIND] >= 0.0) {
        best = driven_candidate(chosen);
        cost = (1.0 - s->hysteresis) * roll_on(course, &best, INFINITY);
    }
    const int end_2 = FIRST + FOLLOWS + HOLDS;
    for (int number = ends(course) ? 0 : 1; number < end_2; number++) {
        if (number == STANDING && !waits) {
            continue;
        }
        candidate = listed(fastest, number);
        share = side_share(&candidate, chosen.at[CHOICE_SIDE]);
        if (number <= STANDING) {
            share = share - (number == STANDING ? s->hysteresis : s->preference);
        }
        found = share * roll_on(course, &candidate, cost / share);
        if (found < LESS * cost) {
            best = candidate;
            cost = found;
        }
    }
    if (best.kind == FOLLOW) {
        const Candidate about = best;
        const tuple_dd among_4[] = {(tuple_dd){-0.15, 0.0}, (tuple_dd){0.15, 0.0},
            (tuple_dd){0.0, 0.15}, (tuple_dd){0.0, -0.15}};
        for (int turn_3 = 0; turn_3 < 4; turn_3++) {
            const tuple_dd change = among_4[turn_3];
            const double pace = min2(max2(about.b + change._1, 0.0), 1.0);
            candidate = (Candidate){FOLLOW, about.a + change._0, pace, 0.0};
            share = side_share(&candidate, chosen.at[CHOICE_SIDE]);
            found = share * roll_on(course, &candidate, cost / share);
            if (found < LESS * cost) {
                best = candidate;
                cost = found;
            }
        }
    }
    return best;
}

/* qpavoid.guide.choice: Choose the candidate to drive, and remember it in place of the
 * last one. */
static void choose(const Course *restrict course, vector chosen, bool waits)
{
    const bool still = !any_moves(&course->scene);
    if (chosen.at[CHOICE_KIND] == TRACK && chosen.at[LEFT] > 0.5) {
        chosen.at[LEFT] = chosen.at[LEFT] - 1.0;
        if (still) {
            return;
        }
    }
    if (chosen.at[CHOICE_KIND] == HOLD) {
        chosen.at[LEFT] = chosen.at[LEFT] - 1.0;
        if (chosen.at[LEFT] < 0.5) {
            chosen.at[CHOICE_KIND] = ends(course) ? PARK : TRACK;
        }
    }
    Candidate best = (Candidate){-1.0, 0.0, 0.0, 0.0};
    if (has_come(course)) {
        best = soonest_parked(course, chosen);
        const double x = course->ahead.at[X];
        const double y = course->ahead.at[Y];
        if (best.kind == NOT_CHOSEN && x * x + y * y < BESIDE * BESIDE) {
            best = listed(0.0, 0);
        }
    }
    if (best.kind == NOT_CHOSEN) {
        best = cheapest(course, chosen, waits);
    }
    chosen.at[CHOICE_KIND] = best.kind;
    chosen.at[A] = best.a;
    chosen.at[B] = best.b;
    chosen.at[LEFT] = best.held;
    if (still && best.kind == FOLLOW && best.a != 0.0) {
        chosen.at[CHOICE_SIDE] = copysign(KEPT, best.a);
    } else {
        chosen.at[CHOICE_SIDE] = chosen.at[CHOICE_SIDE] -
            min2(max2(chosen.at[CHOICE_SIDE], -1.0), 1.0);
    }
}

/* qpavoid.guide.choice: Return what a candidate drives now; ``desired`` is that of
 * tracking. */
static tuple_dd twist_of(const Course *restrict course, const Candidate *restrict
    candidate, tuple_dd desired)
{
    if (candidate->kind == HOLD) {
        return (tuple_dd){candidate->a, candidate->b};
    }
    if (candidate->kind == PARK) {
        return parking(course, (const tuple_ddd[]){(tuple_ddd){0.0, 0.0, 0.0}});
    }
    if (candidate->kind != FOLLOW) {
        return desired;
    }
    const Frame at = (Frame){0.0, 0.0, 1.0, 0.0};
    const int row = nearest_row(course->ahead, 0, &at);
    const vector robot_ = course->scene.robot;
    const matrix ahead = course->ahead;
    return follow_twist(robot_, ahead, &at, row, candidate->b, candidate->a);
}

/* qpavoid.guide.stage: Return the twist of the candidate that comes nearest to the
 * reference. */
static tuple_dd track_by_candidate(const Stage *restrict stage, vector state, matrix
    bodies, const tuple_mm *restrict obstacles, const Tracking *restrict tracking)
{
    Course course = {0};
    Scene scene = {0};
    const guide_settings s = stage->settings;
    const vector chosen = part(state, STAGE_CHOSEN, WAY);
    if (s->horizon == 0.0) {
        return tracking->desired;
    }
    state.at[DUE] = state.at[DUE] - 1.0;
    if (state.at[DUE] < 0.5) {
        state.at[DUE] = max2(1.0, rint(TICK / tracking->dt));
        scene = scene_of(stage, bodies, tracking);
        const int count = bodies_in_reach(&scene, obstacles, 0.0, s->horizon);
        scene = scene_of(stage, band(bodies, 0, count), tracking);
        if (state.at[STILL] >= s->blocked_time && !any_moves(&scene)) {
            stand_still(chosen);
        } else {
            course = (Course){scene, tracking->ahead, stage->law, stage->settings};
            choose(&course, chosen, state.at[STILL] > s->stall_time / 2.0);
        }
    }
    scene = scene_of(stage, band(bodies, 0, 0), tracking);
    course = (Course){scene, tracking->ahead, stage->law, stage->settings};
    return twist_of(&course, (const Candidate[]){driven_candidate(chosen)},
        tracking->desired);
}

/* qpavoid.guide.state: Return whether the way has been followed to its end. */
static bool is_done(vector state)
{
    return state.at[PLACE] >= state.at[COUNT];
}

/* qpavoid.avoidance.settings: Return the curve of a record of settings, of the filter
 * or of the guide. */
static RadiusCurve radius_curve2(guide_settings settings_)
{
    const guide_settings s = settings_;
    return (RadiusCurve){s->r_min_slow, s->r_min_fast, s->speed_low, s->speed_high};
}

/* qpavoid.guide.room: Return how many nodes a side of a grid over [−half, half]² has.
 * */
static int grid_size(double half)
{
    return 2 * whole(rint(half / ROOM_FINE)) + 1;
}

/* qpavoid.guide.way: Return the field, not filled in, that the memory of a search
 * begins with. */
static Field field_in(vector memory, double half, matrix body)
{
    const int n = grid_size(half);
    return (Field){shaped(part(memory, 0, n * n), n, n), half, body};
}

/* qpavoid.guide.room: Lower the field to the distance from a segment less ``radius``,
 * in place. */
static void _lower(matrix field, double half, double ample, const Segment *restrict
    axis, double radius)
{
    const int n = field.rows;
    const double x_1 = axis->x1;
    const double y_1 = axis->y1;
    const double x_2 = axis->x2;
    const double y_2 = axis->y2;
    const double wide = radius + ample + half;
    const int first_i = imax(whole(ceil((min2(x_1, x_2) - radius - ample + half) /
        ROOM_FINE)), 0);
    const int last_i = imin(whole(floor((max2(x_1, x_2) + wide) / ROOM_FINE)), n - 1);
    const int first_j = imax(whole(ceil((min2(y_1, y_2) - radius - ample + half) /
        ROOM_FINE)), 0);
    const int last_j = imin(whole(floor((max2(y_1, y_2) + wide) / ROOM_FINE)), n - 1);
    const int end_2 = last_i + 1;
    for (int i = first_i; i < end_2; i++) {
        const int end_4 = last_j + 1;
        for (int j = first_j; j < end_4; j++) {
            const tuple_dd from_segment_5 = from_segment(axis, i * ROOM_FINE - half, j
                * ROOM_FINE - half);
            const double d_x = from_segment_5._0;
            const double d_y = from_segment_5._1;
            field.at[i * field.columns + j] = min2(field.at[i * field.columns + j],
                sqrt(d_x * d_x + d_y * d_y) - radius);
        }
    }
}

/* qpavoid.model.capsules: Return whether (x, y) lies within a polygon, whose rows these
 * are. */
static bool holds_point(matrix chain, double x, double y)
{
    const int end_2 = chain.rows;
    for (int i = 0; i < end_2; i++) {
        const double d_x = chain.at[i * chain.columns + X2] - chain.at[i * chain.columns
            + X1];
        const double d_y = chain.at[i * chain.columns + Y2] - chain.at[i * chain.columns
            + Y1];
        if (d_x * (y - chain.at[i * chain.columns + Y1]) < d_y * (x - chain.at[i *
            chain.columns + X1])) {
            return false;
        }
    }
    return true;
}

/* qpavoid.guide.room: Lower the field to ``room`` within a polygon, in place. */
static void _fill(matrix field, double half, matrix chain, double room)
{
    const int n = field.rows;
    double x_low = INFINITY;
    double y_low = INFINITY;
    double x_high = -INFINITY;
    double y_high = -INFINITY;
    const int end_2 = chain.rows;
    for (int i = 0; i < end_2; i++) {
        x_low = min2(x_low, chain.at[i * chain.columns + X1]);
        x_high = max2(x_high, chain.at[i * chain.columns + X1]);
        y_low = min2(y_low, chain.at[i * chain.columns + Y1]);
        y_high = max2(y_high, chain.at[i * chain.columns + Y1]);
    }
    const int first_j = imax(whole(ceil((y_low + half) / ROOM_FINE)), 0);
    const int last_j = imin(whole(floor((y_high + half) / ROOM_FINE)), n - 1);
    const int end_4 = imin(whole(floor((x_high + half) / ROOM_FINE)), n - 1) + 1;
    for (int i = imax(whole(ceil((x_low + half) / ROOM_FINE)), 0); i < end_4; i++) {
        const int end_6 = last_j + 1;
        for (int j = first_j; j < end_6; j++) {
            if (holds_point(chain, i * ROOM_FINE - half, j * ROOM_FINE - half)) {
                field.at[i * field.columns + j] = min2(field.at[i * field.columns + j],
                    room);
            }
        }
    }
}

/* qpavoid.guide.room: Fill in the room (n, n) at the nodes of a grid over [−half,
 * half]², m. */
static void room_field(double half, double ample, const RadiusCurve *restrict curve,
    const tuple_mm *restrict obstacles, matrix nodes)
{
    const int n = grid_size(half);
    const matrix points = obstacles->_0;
    const matrix capsules = obstacles->_1;
    const int end_2 = n;
    for (int i = 0; i < end_2; i++) {
        const int end_4 = n;
        for (int j = 0; j < end_4; j++) {
            nodes.at[i * nodes.columns + j] = ample;
        }
    }
    const double low = safety_radius(0.0, curve);
    const int end_6 = points.rows;
    for (int i = 0; i < end_6; i++) {
        const double x = points.at[i * points.columns + 0];
        const double y = points.at[i * points.columns + 1];
        _lower(nodes, half, ample, (const Segment[]){(Segment){x, y, x, y}}, low);
    }
    int end = 0;
    while (end < capsules.rows) {
        const int begin = end;
        end = chain_end(capsules, end);
        const int end_8 = end;
        for (int i = begin; i < end_8; i++) {
            const double speed = speed_bound(capsules, i);
            const double r_min = safety_radius(speed, curve);
            const double wide = capsules.at[i * capsules.columns + RADIUS] + r_min;
            _lower(nodes, half, ample, (const Segment[]){capsule_at(capsules, i, 0.0)},
                wide);
        }
        if (end > begin + 1) {
            _fill(nodes, half, band(capsules, begin, end), -low);
        }
    }
}

/* qpavoid.guide.room: Return the least room, m, of the points of the body at a pose. */
static double pose_room(const Field *restrict field, double x, double y, double heading)
{
    const double cos_ = cos(heading);
    const double sin_ = sin(heading);
    double least = AMPLE;
    const matrix nodes = field->nodes;
    const double half = field->half;
    const matrix body = field->body;
    const int n = field->nodes.rows;
    const int end_2 = body.rows;
    for (int k = 0; k < end_2; k++) {
        double u = (x + cos_ * body.at[k * body.columns + 0] - sin_ * body.at[k *
            body.columns + 1] + half) / ROOM_FINE;
        double w = (y + sin_ * body.at[k * body.columns + 0] + cos_ * body.at[k *
            body.columns + 1] + half) / ROOM_FINE;
        if (!((0.0 <= u && u < n - 1) && (0.0 <= w && w < n - 1))) {
            continue;
        }
        const int i = whole(u);
        const int j = whole(w);
        u = u - i;
        w = w - j;
        double room = (1.0 - u) * ((1.0 - w) * nodes.at[i * nodes.columns + j] + w *
            nodes.at[i * nodes.columns + j + 1]);
        room = room + u * ((1.0 - w) * nodes.at[(i + 1) * nodes.columns + j] + w *
            nodes.at[(i + 1) * nodes.columns + j + 1]);
        least = min2(least, room);
    }
    return least;
}

/* qpavoid.guide.stage: Return whether there is a free place to go to, and it, robot
 * frame, m. */
static tuple_bdd _target(const Field *restrict field, double clearance, const tuple_ddd
    *restrict error, bool moving)
{
    const double e_x = error->_0;
    const double e_y = error->_1;
    const double e_gamma = error->_2;
    const double cos_ = cos(e_gamma);
    const double sin_ = sin(e_gamma);
    const double passed = -(e_x * cos_ + e_y * sin_);
    const double start = moving && passed > 0.0 ? passed + STAGE_AHEAD : 0.0;
    const int steps = moving ? whole(ceil(2.0 * field->half / CELL)) : 1;
    const int end_2 = steps;
    for (int k = 0; k < end_2; k++) {
        const double x = e_x + (start + k * CELL) * cos_;
        const double y = e_y + (start + k * CELL) * sin_;
        if (pose_room(field, x, y, e_gamma) >= clearance) {
            return (tuple_bdd){true, x, y};
        }
    }
    return (tuple_bdd){false, e_x, e_y};
}

/* qpavoid.guide.room: Return the least room of a turn towards (x, y), the way there, a
 * turn to heading. */
static double line_room(const Field *restrict field, double x, double y, double heading)
{
    const double bearing = atan2(y, x);
    double least = AMPLE;
    const int end_2 = SPOT_STEPS + 1;
    for (int k = 0; k < end_2; k++) {
        least = min2(least, pose_room(field, 0.0, 0.0, bearing * k / SPOT_STEPS));
    }
    const int count = whole(ceil(sqrt(x * x + y * y) / (2.0 * ROOM_FINE)));
    const int end_4 = count + 1;
    for (int k = 1; k < end_4; k++) {
        const double p_x = x * k / count;
        const double p_y = y * k / count;
        least = min2(least, pose_room(field, p_x, p_y, bearing));
    }
    const double turn = wrap_angle(heading - bearing);
    const int end_6 = SPOT_STEPS + 1;
    for (int k = 1; k < end_6; k++) {
        const double end = bearing + turn * k / SPOT_STEPS;
        least = min2(least, pose_room(field, x, y, end));
    }
    return least;
}

/* qpavoid.guide.choice: Choose to track for a while, unweighed as long as nothing
 * moves. */
static void track_on(vector chosen)
{
    chosen.at[CHOICE_KIND] = TRACK;
    chosen.at[A] = 0.0;
    chosen.at[B] = 1.0;
    chosen.at[LEFT] = TRACKED_TICKS;
}

/* qpavoid.guide.state: Return the least room on what is left of the way, m. */
static double way_room(vector state, const Field *restrict field)
{
    double x = state.at[LEAD];
    double y = state.at[LEAD + 1];
    double turn = state.at[LEAD + 2];
    double least = AMPLE;
    double share = 1.0 - state.at[SHARE];
    const int end_2 = whole(state.at[COUNT]);
    for (int k = whole(state.at[PLACE]); k < end_2; k++) {
        const tuple_dd one_3 = ((const tuple_dd[]){(tuple_dd){1.0, 0.0}, (tuple_dd){1.0,
            1.0}, (tuple_dd){1.0, -1.0}, (tuple_dd){1.0, 2.0}, (tuple_dd){1.0, -2.0},
            (tuple_dd){0.0, 1.0}, (tuple_dd){0.0, -1.0}, (tuple_dd){-1.0, 0.0},
            (tuple_dd){-1.0, 1.0}, (tuple_dd){-1.0, -1.0}})[whole(state.at[WAY + k])];
        const double drive = one_3._0;
        const double bend = one_3._1;
        const tuple_ddd arc_4 = arc(x, y, turn, drive * STATE_STEP, bend * STATE_TURN,
            share);
        x = arc_4._0;
        y = arc_4._1;
        turn = arc_4._2;
        least = min2(least, pose_room(field, x, y, turn));
        share = 1.0;
    }
    return least;
}

/* qpavoid.guide.state: Begin to back out, unless that has been tried often enough; say
 * whether. */
static bool back_out(vector state, double speed)
{
    if (state.at[BACKS] >= MOST_BACKS || speed == 0.0) {
        return false;
    }
    state.at[MODE] = BACKING;
    state.at[BACKED] = 0.0;
    state.at[BACKS] = state.at[BACKS] + 1.0;
    return true;
}

/* qpavoid.guide.stage: Return whether nothing need be searched: the way is free, done,
 * or backed out. */
static bool _goes_on(vector state, const Field *restrict field, guide_settings
    settings_)
{
    const guide_settings s = settings_;
    if (state.at[MODE] != DETOUR) {
        state.at[BEGUN] = 0.0;
        return false;
    }
    if (is_done(state)) {
        clear(state);
        return true;
    }
    if (min2(state.at[STILL], state.at[BEGUN]) < s->stall_time) {
        return way_room(state, field) >= 0.0;
    }
    state.at[FAILED] = state.at[FAILED] + 1.0;
    state.at[BEGUN] = 0.0;
    return back_out(state, s->back_speed);
}

/* qpavoid.guide.geodesic: Return how many cells a side of the grid of places has. */
static int cells_of(double half)
{
    return quotient(grid_size(half) + 1, 2);
}

/* qpavoid.guide.way: Return how many items wait at most: a cell is reached from eight,
 * or the edge. */
static int most_waiting(double half)
{
    const int n = cells_of(half);
    return imax(8 * n * n + 4 * n, MOST_NODES);
}

/* qpavoid.guide.way: Return the tree, not filled in, in the memory of a search behind
 * the field. */
static Tree tree_in(vector memory, double half)
{
    const int n = grid_size(half);
    const int cells = cells_of(half);
    const int waiting = most_waiting(half);
    const int a = n * n;
    const int b = a + MOST_NODES * NODE;
    const int c = b + MOST_NODES * LINK;
    const int d = c + cells * cells * HEADINGS;
    const int e = d + cells * cells;
    const int f = e + waiting * HEAP_WIDTH;
    return (Tree){shaped(part(memory, a, b), MOST_NODES, NODE), shaped(part(memory, b,
        c), MOST_NODES, LINK), shaped(part(memory, c, d), cells * cells, HEADINGS),
        shaped(part(memory, d, e), cells, cells), shaped(part(memory, e, f), waiting,
        HEAP_WIDTH)};
}

/* qpavoid.guide.heap: Return what waits in a row. */
static Item item_at(matrix heap, int row)
{
    return (Item){heap.at[row * heap.columns + 0], whole(heap.at[row * heap.columns +
        1]), whole(heap.at[row * heap.columns + 2])};
}

/* qpavoid.guide.heap: Return whether one item comes before another, as tuples do. */
static bool is_before(const Item *restrict one, const Item *restrict other)
{
    if (one->cost != other->cost) {
        return one->cost < other->cost;
    }
    if (one->i != other->i) {
        return one->i < other->i;
    }
    return one->j < other->j;
}

/* qpavoid.guide.heap: Write a row. */
static void set_item(matrix heap, int row, const Item *restrict item)
{
    heap.at[row * heap.columns + 0] = item->cost;
    heap.at[row * heap.columns + 1] = item->i;
    heap.at[row * heap.columns + 2] = item->j;
}

/* qpavoid.guide.heap: Add an item to so many, and return how many there are then. */
static int push(matrix heap, int count, const Item *restrict item)
{
    int row = count;
    while (row > 0) {
        const int above = quotient(row - 1, 2);
        if (!is_before(item, (const Item[]){item_at(heap, above)})) {
            break;
        }
        set_item(heap, row, (const Item[]){item_at(heap, above)});
        row = above;
    }
    set_item(heap, row, item);
    return count + 1;
}

/* qpavoid.guide.geodesic:  */
static double _length(double x, double y)
{
    return sqrt(x * x + y * y);
}

/* qpavoid.guide.geodesic: Return on which side of a wall's line a place is: the sign of
 * the number. */
static double _cross(const Segment *restrict wall, double x, double y)
{
    const double d_x = wall->x2 - wall->x1;
    const double d_y = wall->y2 - wall->y1;
    return d_x * (y - wall->y1) - d_y * (x - wall->x1);
}

/* qpavoid.guide.geodesic: Return a bound on the way from a place to the goal, m: round
 * each wall alone. */
static double way_beyond(const Goal *restrict goal, double x, double y)
{
    const Segment way = (Segment){x, y, goal->x, goal->y};
    double least = _length(goal->x - x, goal->y - y);
    const int end_2 = goal->walls.rows;
    for (int i = 0; i < end_2; i++) {
        const Segment wall = axis_of(goal->walls, i);
        const double apart = _cross(&wall, x, y) * _cross(&wall, goal->x, goal->y);
        const double beside = _cross(&way, wall.x1, wall.y1) * _cross(&way, wall.x2,
            wall.y2);
        if (apart < 0.0 && beside < 0.0) {
            double first = _length(wall.x1 - x, wall.y1 - y);
            first = first + _length(goal->x - wall.x1, goal->y - wall.y1);
            double second = _length(wall.x2 - x, wall.y2 - y);
            second = second + _length(goal->x - wall.x2, goal->y - wall.y2);
            least = max2(least, min2(first, second));
        }
    }
    return least;
}

/* qpavoid.guide.heap: Take the first of so many items out, and return how many are
 * left. */
static int drop_first(matrix heap, int count)
{
    const Item last = item_at(heap, count - 1);
    int row = 0;
    while (2 * row + 1 < count - 1) {
        int below = 2 * row + 1;
        if (below + 1 < count - 1) {
            if (is_before((const Item[]){item_at(heap, below + 1)}, (const
                Item[]){item_at(heap, below)})) {
                below = below + 1;
            }
        }
        if (!is_before((const Item[]){item_at(heap, below)}, &last)) {
            break;
        }
        set_item(heap, row, (const Item[]){item_at(heap, below)});
        row = below;
    }
    set_item(heap, row, &last);
    return count - 1;
}

/* qpavoid.guide.geodesic: Fill in the distance, m, from the grid's nodes to a goal by
 * passable ones. */
static void geodesic(const Field *restrict field, double least, const Goal *restrict
    goal, matrix cost, matrix heap)
{
    int i = 0;
    int j = 0;
    int k = 0;
    const matrix nodes = field->nodes;
    const double half = field->half;
    const int n = cost.rows;
    int count = 0;
    const int end_2 = n;
    for (int turn_1 = 0; turn_1 < end_2; turn_1++) {
        i = turn_1;
        const int end_4 = n;
        for (int turn_3 = 0; turn_3 < end_4; turn_3++) {
            j = turn_3;
            cost.at[i * cost.columns + j] = INFINITY;
        }
    }
    if (max2(fabs(goal->x), fabs(goal->y)) <= half) {
        i = whole(rint((goal->x + half) / CELL));
        j = whole(rint((goal->y + half) / CELL));
        cost.at[i * cost.columns + j] = 0.0;
        count = push(heap, count, (const Item[]){(Item){0.0, i, j}});
    } else {
        const int end_6 = n;
        for (int turn_5 = 0; turn_5 < end_6; turn_5++) {
            k = turn_5;
            const tuple_ii among_8[] = {(tuple_ii){k, 0}, (tuple_ii){k, n - 1},
                (tuple_ii){0, k}, (tuple_ii){n - 1, k}};
            for (int turn_7 = 0; turn_7 < 4; turn_7++) {
                const tuple_ii one_9 = among_8[turn_7];
                i = one_9._0;
                j = one_9._1;
                if (nodes.at[(2 * i) * nodes.columns + 2 * j] >= least) {
                    cost.at[i * cost.columns + j] = way_beyond(goal, i * CELL - half, j
                        * CELL - half);
                    count = push(heap, count, (const Item[]){(Item){cost.at[i *
                        cost.columns + j], i, j}});
                }
            }
        }
    }
    while (count > 0) {
        const Item item_at_10 = item_at(heap, 0);
        const double known = item_at_10.cost;
        i = item_at_10.i;
        j = item_at_10.j;
        count = drop_first(heap, count);
        if (known > cost.at[i * cost.columns + j]) {
            continue;
        }
        for (int d_i = -1; d_i < 2; d_i++) {
            for (int d_j = -1; d_j < 2; d_j++) {
                k = i + d_i;
                const int m = j + d_j;
                if (!((0 <= k && k < n) && (0 <= m && m < n)) || nodes.at[(2 * k) *
                    nodes.columns + 2 * m] < least) {
                    continue;
                }
                const double tight = 1.0 - min2((nodes.at[(2 * k) * nodes.columns + 2 *
                    m] - least) / AMPLE, 1.0);
                const double step = CELL * sqrt(d_i * d_i + d_j * d_j);
                const double longer = known + step * (1.0 + TIGHT_COST * tight * tight);
                if (longer < cost.at[k * cost.columns + m]) {
                    cost.at[k * cost.columns + m] = longer;
                    count = push(heap, count, (const Item[]){(Item){longer, k, m}});
                }
            }
        }
    }
}

/* qpavoid.guide.way: Write the first node: where the robot is. */
static void begin_tree(const Field *restrict field, const Tree *restrict tree)
{
    const vector node = row_of(tree->nodes, 0);
    const vector link = row_of(tree->links, 0);
    node.at[0] = 0.0;
    node.at[1] = 0.0;
    node.at[2] = 0.0;
    node.at[4] = 0.0;
    node.at[3] = pose_room(field, 0.0, 0.0, 0.0);
    link.at[0] = 0.0;
    link.at[1] = -1.0;
    link.at[2] = -1.0;
}

/* qpavoid.guide.way: Return the cell and heading that tell places apart. */
static tuple_iii _bin(double half, const Tree *restrict tree, int node)
{
    const double x = tree->nodes.at[node * tree->nodes.columns + 0];
    const double y = tree->nodes.at[node * tree->nodes.columns + 1];
    return (tuple_iii){whole(rint((x + half) / CELL)), whole(rint((y + half) / CELL)),
        whole(tree->links.at[node * tree->links.columns + 0])};
}

/* qpavoid.guide.way: Return whether a way may end at a node: near the target, or on the
 * way beyond. */
static bool _arrives(double half, const Search *restrict search, const Tree *restrict
    tree, int node)
{
    const double x = search->target._0;
    const double y = search->target._1;
    const double heading = search->target._2;
    const tuple_iii one_1 = _bin(half, tree, node);
    const int i = one_1._0;
    const int j = one_1._1;
    const int k = one_1._2;
    const double off = search->turned ? fabs(wrap_angle(heading - k * WAY_TURN)) : 0.0;
    const double away = sqrt(square(tree->nodes.at[node * tree->nodes.columns + 0] - x) +
        square(tree->nodes.at[node * tree->nodes.columns + 1] - y));
    const int n = tree->remaining.rows;
    const bool inside = (0 < i && i < n - 1) && (0 < j && j < n - 1);
    const bool beyond = max2(fabs(x), fabs(y)) > half;
    return (away <= WAY_CLOSE && off <= ALIGNED) || (beyond && !inside);
}

/* qpavoid.guide.way: Write the actions that lead to a node, first to last; return their
 * number. */
static int _trace(matrix links, int node, vector way)
{
    int count = 0;
    int step = node;
    while (links.at[step * links.columns + 1] >= 0.0) {
        count = count + 1;
        step = whole(links.at[step * links.columns + 1]);
    }
    int place = count;
    while (links.at[node * links.columns + 1] >= 0.0) {
        place = place - 1;
        if (place < way.rows) {
            way.at[place] = links.at[node * links.columns + 2];
        }
        node = whole(links.at[node * links.columns + 1]);
    }
    return imin(count, way.rows);
}

/* qpavoid.guide.way: Return the room that a child must have, m: less where the robot
 * only leaves. */
static double _least_room(const Search *restrict search, const Tree *restrict tree, int
    parent)
{
    double floor_ = tree->nodes.at[parent * tree->nodes.columns + 3] - 0.15 * search->loss;
    if (tree->nodes.at[parent * tree->nodes.columns + 2] < LEAVING) {
        floor_ = min2(floor_, tree->nodes.at[3] - search->loss);
    }
    return min2(search->clearance, floor_);
}

/* qpavoid.guide.way: Return the cost of one action, m. */
static double _cost(double drive, double turn, double direction, double room)
{
    double cost = TURN_COST * fabs(turn);
    if (drive != 0.0) {
        const double near = 1.0 - max2(min2(room, AMPLE), 0.0) / AMPLE;
        cost = cost + WAY_STEP * (1.0 + NEAR_COST * near * near);
    }
    if (drive < 0.0) {
        cost = cost * REVERSE_COST;
    }
    if (drive * direction < 0.0) {
        cost = cost + CHANGE_COST;
    }
    return cost;
}

/* qpavoid.guide.way: Fill in the node that an action leads to. */
static void _drive(const Field *restrict field, const Tree *restrict tree, int parent,
    int action, int child)
{
    const tuple_dd one_1 = ((const tuple_dd[]){(tuple_dd){1.0, 0.0}, (tuple_dd){1.0,
        1.0}, (tuple_dd){1.0, -1.0}, (tuple_dd){1.0, 2.0}, (tuple_dd){1.0, -2.0},
        (tuple_dd){0.0, 1.0}, (tuple_dd){0.0, -1.0}, (tuple_dd){-1.0, 0.0},
        (tuple_dd){-1.0, 1.0}, (tuple_dd){-1.0, -1.0}})[action];
    const double drive = one_1._0;
    const double turn = one_1._1;
    const vector node = row_of(tree->nodes, child);
    const vector from_ = row_of(tree->nodes, parent);
    const double heading = tree->links.at[parent * tree->links.columns + 0];
    const vector link = row_of(tree->links, child);
    const double start = heading * WAY_TURN;
    const double length = drive * WAY_STEP;
    const double bend = turn * WAY_TURN;
    const tuple_ddd arc_2 = arc(from_.at[0], from_.at[1], start, length, bend, 0.5);
    const double m_x = arc_2._0;
    const double m_y = arc_2._1;
    const double middle = arc_2._2;
    const tuple_ddd arc_3 = arc(from_.at[0], from_.at[1], start, length, bend, 1.0);
    const double x = arc_3._0;
    const double y = arc_3._1;
    const double end = arc_3._2;
    const double room = min2(pose_room(field, m_x, m_y, middle), pose_room(field, x,
        y, end));
    node.at[0] = x;
    node.at[1] = y;
    node.at[3] = room;
    node.at[2] = from_.at[2] + _cost(drive, turn, from_.at[4], room);
    node.at[4] = drive != 0.0 ? drive : from_.at[4];
    link.at[0] = modulo(whole(heading) + whole(turn), HEADINGS);
    link.at[1] = parent;
    link.at[2] = action;
}

/* qpavoid.guide.way: Return the number of actions of a way from the robot to a target.
 * */
static int find_way(const Field *restrict field, const Search *restrict search, vector
    memory, vector way)
{
    int place = 0;
    const Tree tree = tree_in(memory, field->half);
    const double floor_ = search->inner + search->clearance;
    const matrix nodes = tree.nodes;
    const matrix best = tree.best;
    const matrix remaining = tree.remaining;
    const matrix heap = tree.heap;
    const Goal goal = (Goal){search->target._0, search->target._1, search->walls};
    geodesic(field, floor_ - 0.75 * CELL, &goal, remaining, heap);
    const int n = remaining.rows;
    const int middle = quotient(remaining.rows, 2);
    if (remaining.at[middle * remaining.columns + middle] == INFINITY) {
        return -1;
    }
    const int end_2 = n * n;
    for (int turn_1 = 0; turn_1 < end_2; turn_1++) {
        place = turn_1;
        for (int heading = 0; heading < HEADINGS; heading++) {
            best.at[place * best.columns + heading] = INFINITY;
        }
    }
    begin_tree(field, &tree);
    best.at[(middle * n + middle) * best.columns + 0] = 0.0;
    int waiting = push(heap, 0, (const Item[]){(Item){remaining.at[middle *
        remaining.columns + middle], 0, 0}});
    int count = 1;
    const int kinds = search->reverse ? 10 : 10 - 3;
    while (waiting > 0 && count < MOST_NODES - kinds) {
        const int parent = item_at(heap, 0).i;
        waiting = drop_first(heap, waiting);
        const tuple_iii one_4 = _bin(field->half, &tree, parent);
        int i = one_4._0;
        int j = one_4._1;
        int k = one_4._2;
        if (nodes.at[parent * nodes.columns + 2] > best.at[(i * n + j) * best.columns +
            k] + SAME) {
            continue;
        }
        if (parent > 0 && _arrives(field->half, search, &tree, parent)) {
            return _trace(tree.links, parent, way);
        }
        const double least = _least_room(search, &tree, parent);
        const int end_6 = kinds;
        for (int action = 0; action < end_6; action++) {
            _drive(field, &tree, parent, action, count);
            const tuple_iii one_7 = _bin(field->half, &tree, count);
            i = one_7._0;
            j = one_7._1;
            k = one_7._2;
            if (!((0 <= i && i < n) && (0 <= j && j < n)) || remaining.at[i *
                remaining.columns + j] == INFINITY) {
                continue;
            }
            const double cost = nodes.at[count * nodes.columns + 2];
            place = i * n + j;
            if (nodes.at[count * nodes.columns + 3] < least || cost >= best.at[place *
                best.columns + k] - SAME) {
                continue;
            }
            best.at[place * best.columns + k] = cost;
            const double total = cost + GREED * remaining.at[i * remaining.columns + j];
            waiting = push(heap, waiting, (const Item[]){(Item){total, count, 0}});
            count = count + 1;
        }
    }
    return 0;
}

/* qpavoid.guide.stage: Look at the obstacles: go back to tracking, keep the way, or
 * find another. */
static void _look(vector state, const Field *restrict field, guide_settings settings_,
    vector memory, const tuple_mm *restrict obstacles, const Tracking *restrict
    tracking)
{
    double clearance = 0;
    const guide_settings s = settings_;
    const tuple_ddd error = tracking->error;
    const bool moving = fabs(tracking->v_r) > REFERENCE_RESTS;
    const tuple_bdd one_1 = _target(field, s->clearance, &error, moving);
    const bool there = one_1._0;
    const double x = one_1._1;
    const double y = one_1._2;
    const bool straight = there && fabs(atan2(y, x)) < STRAIGHT_WITHIN;
    if (straight && line_room(field, x, y, error._2) >= s->clearance) {
        if (s->horizon > 0.0) {
            track_on(part(state, STAGE_CHOSEN, WAY));
        }
        clear(state);
        return;
    }
    if (_goes_on(state, field, settings_)) {
        return;
    }
    state.at[MODE] = SEARCHING;
    if (!there) {
        return;
    }
    const double more = DEMAND * state.at[FAILED];
    clearance = s->clearance + more;
    const bool reverse = s->back_speed > 0.0;
    const tuple_ddd target = (tuple_ddd){x, y, error._2};
    const double loss = LOSS - more;
    const matrix walls = obstacles->_1;
    const Search search = (Search){s->inner, reverse, clearance, loss, target, !moving,
        walls};
    const int count = find_way(field, &search, memory, part(state, WAY, state.rows));
    if (count > 0) {
        state.at[MODE] = DETOUR;
        state.at[COUNT] = count;
        for (int i = LEAD; i < COUNT; i++) {
            state.at[i] = 0.0;
        }
        return;
    }
    const bool wedged = pose_room(field, 0.0, 0.0, 0.0) < s->clearance;
    if (count == 0 && wedged && back_out(state, s->back_speed)) {
        return;
    }
    if (state.at[STILL] < s->blocked_time) {
        state.at[FAILED] = 0.0;
    }
}

/* qpavoid.guide.state: Return the twist that follows the way; the pose ahead waits for
 * the robot. */
static tuple_dd follow(vector state, double speed, double turn_rate, double dt)
{
    const tuple_dd one_1 = ((const tuple_dd[]){(tuple_dd){1.0, 0.0}, (tuple_dd){1.0,
        1.0}, (tuple_dd){1.0, -1.0}, (tuple_dd){1.0, 2.0}, (tuple_dd){1.0, -2.0},
        (tuple_dd){0.0, 1.0}, (tuple_dd){0.0, -1.0}, (tuple_dd){-1.0, 0.0},
        (tuple_dd){-1.0, 1.0}, (tuple_dd){-1.0, -1.0}})[whole(state.at[WAY +
        whole(state.at[PLACE])])];
    const double drive = one_1._0;
    const double bend = one_1._1;
    const double time = max2(fabs(drive) * STATE_STEP / speed, fabs(bend) * STATE_TURN /
        turn_rate);
    const double v = drive * STATE_STEP / time;
    const double omega = bend * STATE_TURN / time;
    double away = sqrt(square(state.at[LEAD]) + square(state.at[LEAD + 1])) / LEASH;
    away = max2(away, fabs(state.at[LEAD + 2]) / LEASH_TURN);
    const double pace = min2(max2(2.0 - 2.0 * away, 0.0), 1.0);
    const double step = min2(pace * dt, time * (1.0 - state.at[SHARE]));
    const tuple_ddd arc_2 = arc(state.at[LEAD], state.at[LEAD + 1], state.at[LEAD + 2],
        v, omega, step);
    const double x = arc_2._0;
    const double y = arc_2._1;
    const double turn = arc_2._2;
    state.at[LEAD] = x;
    state.at[LEAD + 1] = y;
    state.at[LEAD + 2] = turn;
    state.at[SHARE] = state.at[SHARE] + step / time;
    if (state.at[SHARE] >= DONE) {
        state.at[SHARE] = 0.0;
        state.at[PLACE] = state.at[PLACE] + 1.0;
    }
    return kanayama((const tuple_ddd[]){(tuple_ddd){x, y, turn}}, (tuple_dd){pace * v,
        pace * omega}, (const tuple_ddd[]){(tuple_ddd){1.5, 6.0, 3.0}});
}

/* qpavoid.guide.stage: Return a number of :data:`PROGRESS` and the twist to desire, m/s
 * and rad/s. */
static tuple_idd detour_step(const Stage *restrict stage, vector state, const
    StageMemory *restrict memory, const tuple_mm *restrict obstacles, const Tracking
    *restrict tracking)
{
    const guide_settings settings_ = stage->settings;
    const matrix bodies = memory->bodies;
    double v = tracking->desired._0;
    double omega = tracking->desired._1;
    const guide_settings s = settings_;
    const double e_x = tracking->error._0;
    const double e_y = tracking->error._1;
    const double e_gamma = tracking->error._2;
    note_motion(state, s->progress, tracking->driven, tracking->dt);
    const bool near = sqrt(e_x * e_x + e_y * e_y) < s->tolerance && fabs(e_gamma) <
        s->tolerance;
    const bool wants = fabs(v) > WANTS_V || fabs(omega) > WANTS_OMEGA;
    if (near || (state.at[MODE] == CLEAR && !wants)) {
        clear(state);
    }
    if (state.at[MODE] == CLEAR) {
        if (state.at[STILL] < s->stall_time) {
            const tuple_dd track_by_candidate_1 = track_by_candidate(stage, state,
                bodies, obstacles, tracking);
            v = track_by_candidate_1._0;
            omega = track_by_candidate_1._1;
            return (tuple_idd){CLEAR, v, omega};
        }
        state.at[FAILED] = 0.0;
        state.at[BACKS] = 0.0;
        state.at[DUE] = 0.0;
        state.at[STAGE_CHOSEN + STAGE_KIND] = NOT_CHOSEN;
        state.at[MODE] = SEARCHING;
        state.at[LOOKED] = INFINITY;
    }
    if (state.at[MODE] == BACKING) {
        state.at[BACKED] = state.at[BACKED] + tracking->dt;
        if (state.at[BACKED] < BACK_TIME) {
            return (tuple_idd){BACKING, -s->back_speed, 0.0};
        }
        state.at[MODE] = SEARCHING;
        state.at[LOOKED] = INFINITY;
    }
    const double pause = state.at[MODE] == DETOUR ? s->interval : 2.0 * s->interval;
    if (state.at[LOOKED] >= pause || (state.at[MODE] == DETOUR && is_done(state))) {
        state.at[LOOKED] = 0.0;
        const RadiusCurve curve = radius_curve2(settings_);
        const Field field = field_in(memory->search, s->reach, stage->body);
        room_field(s->reach, s->inner + AMPLE, &curve, obstacles, field.nodes);
        _look(state, &field, settings_, memory->search, obstacles, tracking);
        if (state.at[MODE] == CLEAR) {
            return (tuple_idd){CLEAR, v, omega};
        }
    }
    if (state.at[MODE] == DETOUR) {
        const tuple_dd follow_2 = follow(state, s->speed, s->turn_rate, tracking->dt);
        v = follow_2._0;
        omega = follow_2._1;
        return (tuple_idd){DETOUR, v, omega};
    }
    v = 0.0;
    omega = 0.0;
    if (s->horizon > 0.0) {
        const tuple_dd track_by_candidate_3 = track_by_candidate(stage, state, bodies,
            obstacles, tracking);
        v = track_by_candidate_3._0;
        omega = track_by_candidate_3._1;
    }
    return (tuple_idd){state.at[STILL] >= s->blocked_time ? BLOCKED : SEARCHING, v,
        omega};
}

/* qpavoid.lab.simulation.loop: Return whether a twist is not what the robot would drive
 * if it were alone. */
static bool differs(tuple_dd free, tuple_dd twist)
{
    return fabs(twist._0 - free._0) + fabs(twist._1 - free._1) > LOOP_UNCHANGED;
}

/* qpavoid.model.robot: Return what a robot drives that is said to drive (v, ω): the
 * nearest it can. */
static tuple_dd driven_twist(vector robot_, double v, double omega)
{
    const double share = GREATEST / max2(max2(GREATEST, fabs(v)), fabs(omega));
    return limit_twist(robot_, (tuple_dd){share * v, share * omega}, (tuple_dd){0.0,
        0.0}, INFINITY);
}

/* qpavoid.avoidance.repulsion: Return 1/x, damped to x/(x² + λ²) [Nakamura1986]; 0 at
 * the singular point. */
static double inverse_lever(double lever, double damping)
{
    if (fabs(lever) + damping < SINGULAR_LEVER) {
        return 0.0;
    }
    return lever / (lever * lever + damping * damping);
}

/* qpavoid.avoidance.repulsion: Return J_0⁻¹ ẋ_0 d̂_o, the repulsive twist of Eq. 5,
 * with d̂_o = −n. */
static tuple_dd eq5(double p_x, double p_y, double n_x, double n_y, double speed, double
    damping)
{
    const double turn = -speed * n_y * inverse_lever(p_x, damping);
    return (tuple_dd){-speed * n_x + p_y * turn, turn};
}

/* qpavoid.avoidance.repulsion: Return the repulsive twist of Eq. 7, corrected: (0,
 * ẋ_0/(p_y cos α − p_x sin α)). */
static tuple_dd eq7(double p_x, double p_y, double n_x, double n_y, double speed, double
    damping)
{
    return (tuple_dd){0.0, speed * inverse_lever(p_y * n_x - p_x * n_y, damping)};
}

/* qpavoid.tracking.clock: Return the reference at a place of a plan, linear between
 * rows. */
static Reference row_at(matrix plan, double place)
{
    const int row = imin(whole(place), plan.rows - 2);
    const double share = min2(place - row, 1.0);
    const double old = 1.0 - share;
    const vector a = row_of(plan, row);
    const vector b = row_of(plan, row + 1);
    return (Reference){old * a.at[0] + share * b.at[0], old * a.at[1] + share * b.at[1],
        old * a.at[2] + share * b.at[2], old * a.at[3] + share * b.at[3], old * a.at[4]
        + share * b.at[4]};
}

/* qpavoid.guide.rollout: Fill in the reference ahead, robot frame, a row a tick from a
 * place on. */
static void fill_ahead(matrix plan, double place, const tuple_ddd *restrict pose, double
    stride, matrix ahead)
{
    const double x = pose->_0;
    const double y = pose->_1;
    const double heading = pose->_2;
    const double cos_ = cos(heading);
    const double sin_ = sin(heading);
    const int end_2 = ahead.rows;
    for (int i = 0; i < end_2; i++) {
        const Reference there = row_at(plan, place + i * stride);
        const double d_x = there.x - x;
        const double d_y = there.y - y;
        ahead.at[i * ahead.columns + X] = cos_ * d_x + sin_ * d_y;
        ahead.at[i * ahead.columns + Y] = cos_ * d_y - sin_ * d_x;
        ahead.at[i * ahead.columns + HEADING] = there.heading - heading;
        ahead.at[i * ahead.columns + ROLLOUT_V] = there.v;
        ahead.at[i * ahead.columns + ROLLOUT_OMEGA] = there.omega;
    }
}

/* qpavoid.model.capsules: Write one row of the table. */
static void set_capsule(matrix capsules, int row, const Segment *restrict axis, const
    Rigid *restrict body)
{
    const vector c = row_of(capsules, row);
    c.at[X1] = axis->x1;
    c.at[Y1] = axis->y1;
    c.at[X2] = axis->x2;
    c.at[Y2] = axis->y2;
    c.at[RADIUS] = body->radius;
    c.at[V_X] = body->v_x;
    c.at[V_Y] = body->v_y;
    c.at[TURN] = body->turn;
    c.at[PIVOT_X] = body->pivot._0;
    c.at[PIVOT_Y] = body->pivot._1;
    c.at[OWNER] = body->owner;
}

/* qpavoid.model.capsules: Return whether these corners turn left, each of them, and
 * once round in all. */
static bool is_convex(matrix corners, int begin, int end)
{
    double turned = 0.0;
    const int end_2 = end;
    for (int i = begin; i < end_2; i++) {
        const int j = i + 1 < end ? i + 1 : begin;
        const int k = j + 1 < end ? j + 1 : begin;
        const double a_x = corners.at[j * corners.columns + 0] - corners.at[i *
            corners.columns + 0];
        const double a_y = corners.at[j * corners.columns + 1] - corners.at[i *
            corners.columns + 1];
        const double b_x = corners.at[k * corners.columns + 0] - corners.at[j *
            corners.columns + 0];
        const double b_y = corners.at[k * corners.columns + 1] - corners.at[j *
            corners.columns + 1];
        const double left = a_x * b_y - a_y * b_x;
        const double size = sqrt((a_x * a_x + a_y * a_y) * (b_x * b_x + b_y * b_y));
        if (!(left > CORNER * size)) {
            return false;
        }
        turned = turned + atan2(left, a_x * b_x + a_y * b_y);
    }
    return end - begin > 2 && turned < ONCE_ROUND;
}

/* qpavoid.model.capsules: Return the centroid of the area of a polygon, m: the mean of
 * its triangles. */
static tuple_dd centroid(matrix corners, int begin, int end)
{
    const double x = corners.at[begin * corners.columns + 0];
    const double y = corners.at[begin * corners.columns + 1];
    double area = 0.0;
    double c_x = 0.0;
    double c_y = 0.0;
    const int end_2 = end - 1;
    for (int i = begin + 1; i < end_2; i++) {
        const double a_x = corners.at[i * corners.columns + 0] - x;
        const double a_y = corners.at[i * corners.columns + 1] - y;
        const double b_x = corners.at[(i + 1) * corners.columns + 0] - x;
        const double b_y = corners.at[(i + 1) * corners.columns + 1] - y;
        const double twice = a_x * b_y - a_y * b_x;
        area = area + twice;
        c_x = c_x + twice * (a_x + b_x);
        c_y = c_y + twice * (a_y + b_y);
    }
    return (tuple_dd){x + c_x / (3.0 * area), y + c_y / (3.0 * area)};
}

/* qpavoid.model.capsules: Fill in the table, and say which polygon is none: convex,
 * counter-clockwise. */
static int fill_capsules(int first, matrix discs, matrix disc_velocities, matrix walls,
    matrix wall_velocities, matrix corners, matrix polygons, matrix capsules)
{
    Rigid body = {0};
    tuple_dd pivot = {0};
    vector v = {0};
    int row = 0;
    int owner = first;
    const int end_2 = discs.rows;
    for (int i = 0; i < end_2; i++) {
        const double x = discs.at[i * discs.columns + 0];
        const double y = discs.at[i * discs.columns + 1];
        v = row_of(disc_velocities, i);
        body = (Rigid){discs.at[i * discs.columns + 2], v.at[0], v.at[1], 0.0,
            (tuple_dd){x, y}, owner};
        set_capsule(capsules, row, (const Segment[]){(Segment){x, y, x, y}}, &body);
        row = row + 1;
        owner = owner + 1;
    }
    const int end_4 = walls.rows;
    for (int i = 0; i < end_4; i++) {
        const vector w = row_of(walls, i);
        v = row_of(wall_velocities, i);
        pivot = (tuple_dd){0.5 * (w.at[0] + w.at[2]), 0.5 * (w.at[1] + w.at[3])};
        body = (Rigid){0.0, v.at[0], v.at[1], 0.0, pivot, owner};
        set_capsule(capsules, row, (const Segment[]){(Segment){w.at[0], w.at[1],
            w.at[2], w.at[3]}}, &body);
        row = row + 1;
        owner = owner + 1;
    }
    int begin = 0;
    const int end_6 = polygons.rows;
    for (int i = 0; i < end_6; i++) {
        const int end = begin + whole(polygons.at[i * polygons.columns + 0]);
        if (end > corners.rows || !is_convex(corners, begin, end)) {
            return i;
        }
        const vector p = row_of(polygons, i);
        pivot = centroid(corners, begin, end);
        body = (Rigid){0.0, p.at[1], p.at[2], p.at[3], pivot, owner};
        const int end_8 = end;
        for (int j = begin; j < end_8; j++) {
            const int k = j + 1 < end ? j + 1 : begin;
            const vector a = row_of(corners, j);
            const vector b = row_of(corners, k);
            set_capsule(capsules, row, (const Segment[]){(Segment){a.at[0], a.at[1],
                b.at[0], b.at[1]}}, &body);
            row = row + 1;
        }
        begin = end;
        owner = owner + 1;
    }
    return -1;
}

/* qpavoid.avoidance.prediction: Fill in where a robot is at times (n,); return when it
 * stands, s. */
static double fill_places(const Setup *restrict setup, const Plan *restrict plan,
    tuple_dd twist, vector times, matrix arcs, matrix places)
{
    double dt = 0;
    const double new_1 = setup->settings->dt;
    const matrix edges_ = setup->edges;
    const vector robot_ = setup->robot;
    const filter_settings settings_ = setup->settings;
    dt = new_1;
    const matrix none = band(arcs, 0, 0);
    const tuple_dd still = (tuple_dd){0.0, 0.0};
    const Scene scene = (Scene){edges_, robot_, settings_, none, twist, still, arcs,
        none, dt, 0.0, INFINITY};
    const Plan whole_ = (Plan){plan->v, plan->omega, plan->switch_ + dt, plan->v_then,
        plan->omega_then, plan->end + dt};
    const Rollout rollout = roll_out(&scene, &whole_, twist, dt, 1);
    const int end_3 = times.rows;
    for (int k = 0; k < end_3; k++) {
        const int row = arc_index(rollout.arcs, 0, times.at[k]);
        const Frame at = frame_at((const Arc[]){arc_at(rollout.arcs, row)}, times.at[k],
            dt);
        places.at[k * places.columns + 0] = at.x;
        places.at[k * places.columns + 1] = at.y;
    }
    return rollout.rest;
}

/* qpavoid.model.contacts: Return how many contacts there can be; see
 * :func:`feature_count`. */
static int most_contacts(matrix edges_, const tuple_mm *restrict obstacles)
{
    const matrix capsules = obstacles->_1;
    int end = 0;
    int count = obstacles->_0.rows;
    while (end < capsules.rows) {
        const int begin = end;
        end = chain_end(capsules, end);
        if (has_length(capsules, begin)) {
            count = count + feature_count(edges_, band(capsules, begin, end));
        } else {
            count = count + 1;
        }
        count = imin(count, MOST_COUNTED);
    }
    return count;
}

/* qpavoid.avoidance.workspace: Return how many numbers of memory a step among so many
 * contacts needs. */
static int memory_size(int contacts, filter_settings settings_)
{
    const int sides = most_sides(look_ticks(settings_));
    const double many = (double)contacts;
    const double rows = many + sides + 8 + sides + 4;
    double tables = (many + quotient(contacts, FEW)) * BODY;
    tables = tables + (most_arcs(settings_) * ARC + sides * SIDE);
    tables = tables + 4 * (look_ticks(settings_) + 1);
    const int each = CONTACT_WIDTH + 2 + CAPSULE_WIDTH;
    return whole(many * each + rows * WIDTH + tables);
}

/* qpavoid.model.capsules: Return whether a capsule has a length, stands, and is an
 * obstacle by itself. */
static bool is_plain_wall(matrix capsules, int i)
{
    if (i > 0 && capsules.at[(i - 1) * capsules.columns + OWNER] == capsules.at[i *
        capsules.columns + OWNER]) {
        return false;
    }
    if (i + 1 < capsules.rows && capsules.at[(i + 1) * capsules.columns + OWNER] ==
        capsules.at[i * capsules.columns + OWNER]) {
        return false;
    }
    return has_length(capsules, i) && speed_bound(capsules, i) == 0.0;
}

/* qpavoid.model.capsules: Lengthen wall i by wall j if that goes on where it ends;
 * return if it does. */
static bool lengthened(matrix capsules, int i, int j)
{
    if (capsules.at[i * capsules.columns + RADIUS] != capsules.at[j * capsules.columns +
        RADIUS]) {
        return false;
    }
    for (int k = 0; k < 4; k++) {
        const int a = 2 * quotient(k, 2);
        const int b = 2 * modulo(k, 2);
        const double x = capsules.at[i * capsules.columns + a];
        const double y = capsules.at[i * capsules.columns + a + 1];
        const double d_x = capsules.at[j * capsules.columns + b] - x;
        const double d_y = capsules.at[j * capsules.columns + b + 1] - y;
        if (fabs(d_x) + fabs(d_y) > JOINT) {
            continue;
        }
        const double f_x = capsules.at[i * capsules.columns + 2 - a] - x;
        const double f_y = capsules.at[i * capsules.columns + 3 - a] - y;
        const double g_x = capsules.at[j * capsules.columns + 2 - b] - x;
        const double g_y = capsules.at[j * capsules.columns + 3 - b] - y;
        const double size = sqrt((f_x * f_x + f_y * f_y) * (g_x * g_x + g_y * g_y));
        if (fabs(f_x * g_y - f_y * g_x) <= JOINT * size && f_x * g_x + f_y * g_y < 0.0)
            {
            const double new_2 = capsules.at[j * capsules.columns + 3 - b];
            capsules.at[i * capsules.columns + a] = capsules.at[j * capsules.columns + 2
                - b];
            capsules.at[i * capsules.columns + a + 1] = new_2;
            capsules.at[i * capsules.columns + PIVOT_X] = 0.5 * (capsules.at[i *
                capsules.columns + X1] + capsules.at[i * capsules.columns + X2]);
            capsules.at[i * capsules.columns + PIVOT_Y] = 0.5 * (capsules.at[i *
                capsules.columns + Y1] + capsules.at[i * capsules.columns + Y2]);
            return true;
        }
    }
    return false;
}

/* qpavoid.model.capsules: Copy the capsules, walls that go on straight where others end
 * as one; how many. */
static int join_walls(matrix capsules, matrix joined)
{
    int i = 0;
    int count = 0;
    int many = imin(capsules.rows, JOINED);
    const int end_2 = capsules.rows;
    for (int turn_1 = 0; turn_1 < end_2; turn_1++) {
        i = turn_1;
        for (int column = 0; column < CAPSULE_WIDTH; column++) {
            joined.at[count * joined.columns + column] = capsules.at[i *
                capsules.columns + column];
        }
        count = count + 1;
    }
    i = 0;
    while (i < imin(count, many)) {
        int j = 0;
        bool grown = false;
        while (j < imin(count, many) && is_plain_wall(band(joined, 0, count), i)) {
            if (j != i && is_plain_wall(band(joined, 0, count), j) && lengthened(joined,
                i, j)) {
                const int end_5 = count - 1;
                for (int row = j; row < end_5; row++) {
                    for (int column = 0; column < CAPSULE_WIDTH; column++) {
                        joined.at[row * joined.columns + column] = joined.at[(row + 1) *
                            joined.columns + column];
                    }
                }
                count = count - 1;
                many = many - 1;
                grown = true;
                i = j < i ? i - 1 : i;
                break;
            }
            j = j + 1;
        }
        i = grown ? i : i + 1;
    }
    return count;
}

/* qpavoid.avoidance.state: Return the mean of a velocity that goes to another one,
 * ``most`` in a step. */
static double ramped(double before, double after, double most)
{
    const double gap = after - before;
    return after - 0.5 * gap * min2(fabs(gap) / most, 1.0);
}

/* qpavoid.avoidance.state: Return where the robot will be when the next twist takes
 * effect. */
static Frame frame_of_effect(vector robot_, filter_settings settings_, vector state)
{
    const RobotLimits limits = limits_of(robot_);
    const filter_settings s = settings_;
    Frame at = (Frame){0.0, 0.0, 1.0, 0.0};
    const int many = whole(ceil(s->delay / s->dt - RELATIVE_ROUNDING));
    for (int i = many - 1; i > -1; i += -1) {
        const double lasts = i < many - 1 ? s->dt : s->delay - s->dt * (many - 1);
        double v = state.at[PENDING + 2 * i];
        double omega = state.at[PENDING + 2 * i + 1];
        if ((int)s->ramps != 0 && i + 1 < MOST_PENDING) {
            v = ramped(state.at[PENDING + 2 * i + 2], v, limits.acceleration * s->dt);
            omega = ramped(state.at[PENDING + 2 * i + 3], omega,
                limits.angular_acceleration * s->dt);
        }
        at = moved_on(&at, v, omega, lasts);
    }
    return at;
}

/* qpavoid.avoidance.workspace: Return the obstacles as they are seen when the next
 * twist takes effect. */
static tuple_mm seen_then(const Setup *restrict setup, const tuple_mm *restrict
    obstacles, vector state, const Workspace *restrict space)
{
    const vector robot_ = setup->robot;
    const filter_settings settings_ = setup->settings;
    const matrix points = obstacles->_0;
    matrix capsules = obstacles->_1;
    const int count = join_walls(capsules, space->capsules);
    capsules = band(space->capsules, 0, count);
    if (settings_->delay == 0.0) {
        return (tuple_mm){points, capsules};
    }
    const Frame at = frame_of_effect(robot_, settings_, state);
    const tuple_ddd pose = (tuple_ddd){at.x, at.y, atan2(at.sin, at.cos)};
    const matrix seen = space->points;
    const tuple_mm now = (tuple_mm){points, capsules};
    const tuple_mm then = (tuple_mm){band(seen, 0, points.rows), capsules};
    in_robot_frame(&pose, settings_->delay, &now, &then);
    return then;
}

/* qpavoid.model.capsules: Return the greatest :func:`speed_bound`, m/s; 0 if there is
 * no capsule. */
static double greatest_speed(matrix capsules)
{
    double speed = 0.0;
    const int end_2 = capsules.rows;
    for (int i = 0; i < end_2; i++) {
        speed = max2(speed, speed_bound(capsules, i));
    }
    return speed;
}

/* qpavoid.avoidance.barrier_rows: Return the distance, m, beyond which nothing can
 * violate a row or bar a stop. */
static double row_reach(vector robot_, filter_settings settings_, matrix capsules,
    double age)
{
    const RobotLimits limits = limits_of(robot_);
    const filter_settings s = settings_;
    const double fastest = greatest_speed(capsules);
    const tuple_dd wanted_distance_1 = wanted_distance(settings_, fastest, age);
    const double r_min = wanted_distance_1._0;
    const double wanted = wanted_distance_1._1;
    if ((int)s->bound != BARRIER) {
        return min2(wanted + (s->zone_ratio - 1.0) * r_min, s->reach);
    }
    const double v = max2(-limits.v_min, limits.v_max);
    const double omega = max2(-limits.omega_min, limits.omega_max);
    const double speed = v + omega * limits.circumradius + fastest;
    const double time = 1.0 / s->gamma + s->closing_gain;
    if (!(int)s->braking_room) {
        return min2(wanted + speed * time, s->reach);
    }
    double stop = speed * stopping_time(robot_, v, omega, s->dt) * (1.0 + s->jitter);
    if ((int)s->passive) {
        stop = speed * s->dt * braking_steps(robot_, v, omega, s->dt);
    }
    return wanted + max2(min2(speed * time, s->reach - wanted), stop);
}

/* qpavoid.model.contact: Return d̂_oᵀ J_0 with d̂_o = −normal: P_r's speed away from
 * the obstacle. */
static tuple_dd approach_row(double p_x, double p_y, double n_x, double n_y)
{
    return (tuple_dd){-n_x, n_x * p_y - n_y * p_x};
}

/* qpavoid.avoidance.barrier_rows: Return the greatest closing speed, m/s, that leaves a
 * stop within a margin, m. */
static double closing_bound(vector robot_, double dt, tuple_dd row, double
    stopping_margin)
{
    const RobotLimits limits = limits_of(robot_);
    if (limits.acceleration == INFINITY || limits.angular_acceleration == INFINITY) {
        return stopping_margin / dt;
    }
    const double a_v = row._0;
    const double a_omega = row._1;
    const double a = max2(fabs(a_v) * limits.acceleration, fabs(a_omega) *
        limits.angular_acceleration);
    return sqrt(a * a * dt * dt + 2.0 * a * stopping_margin) - a * dt;
}

/* qpavoid.avoidance.barrier_rows: Return a_v (1), a_ω (m/rad) and b (m/s) of a contact;
 * b = −∞: it gets no row. */
static tuple_ddd contact_bound(const ObstacleContact *restrict contact, vector robot_,
    filter_settings settings_, tuple_dd keep)
{
    double bound = 0;
    double speed = 0;
    const filter_settings s = settings_;
    const ObstacleContact c = (*contact);
    const double r_min = keep._0;
    const double wanted = keep._1;
    const tuple_dd approach_row_1 = approach_row(c.x, c.y, c.n_x, c.n_y);
    const double a_v = approach_row_1._0;
    const double a_omega = approach_row_1._1;
    if ((int)s->bound == BARRIER) {
        const double room = c.distance - wanted;
        speed = sqrt(c.v_x * c.v_x + c.v_y * c.v_y);
        bound = -(room > 0.0 ? s->gamma / (1.0 + s->gamma * s->closing_gain) : s->gamma)
            * room;
        if ((int)s->braking_room && speed <= SPEED_AT_REST && room > 0.0) {
            bound = max2(bound, -closing_bound(robot_, s->dt, (tuple_dd){a_v, a_omega},
                room));
        }
        return (tuple_ddd){a_v, a_omega, bound - (c.n_x * c.v_x + c.n_y * c.v_y)};
    }
    const double r = wanted + (s->zone_ratio - 1.0) * r_min;
    if (c.distance >= r) {
        return (tuple_ddd){a_v, a_omega, -INFINITY};
    }
    return (tuple_ddd){a_v, a_omega, s->speed * activation((int)s->activation,
        c.distance, wanted, r)};
}

/* qpavoid.avoidance.barrier_rows: Return the least value of coefficient · x for x in
 * [low, high]. */
static double least_value(double coefficient, double low, double high)
{
    if (coefficient > 0.0) {
        return coefficient * low;
    }
    return coefficient < 0.0 ? coefficient * high : 0.0;
}

/* qpavoid.avoidance.barrier_rows: Return whether a row holds for every twist of a box.
 * */
static bool is_redundant(tuple_dd row, double bound, const Box *restrict box)
{
    double least = least_value(row._0, box->v_min, box->v_max);
    least = least + least_value(row._1, box->omega_min, box->omega_max);
    return !(least < bound);
}

/* qpavoid.avoidance.barrier_rows: Write a row: a_v (1), a_ω (m/rad), b (m/s) and the
 * obstacle. */
static void set_row(vector row, tuple_dd slope, double bound, int owner)
{
    row.at[A_V] = slope._0;
    row.at[A_OMEGA] = slope._1;
    row.at[B] = bound;
    row.at[BARRIER_ROWS_OWNER] = owner;
}

/* qpavoid.avoidance.barrier_rows: Fill A, b and the obstacle of the contacts' rows;
 * return how many. */
static int constraint_rows(matrix contacts, vector robot_, filter_settings settings_,
    const Box *restrict box, double age, bool ahead, matrix rows)
{
    const filter_settings s = settings_;
    const tuple_dd still = wanted_distance(settings_, 0.0, age);
    int count = 0;
    const double near = still._1 - tolerated(settings_);
    const int end_2 = contacts.rows;
    for (int k = 0; k < end_2; k++) {
        const ObstacleContact c = contact_at(contacts, k);
        const double speed = sqrt(c.v_x * c.v_x + c.v_y * c.v_y);
        if (c.distance > s->reach || (ahead && (speed > SPEED_AT_REST || c.distance >=
            near))) {
            continue;
        }
        const tuple_dd keep = speed == 0.0 ? still : wanted_distance(settings_, speed,
            age);
        const tuple_ddd contact_bound_3 = contact_bound(&c, robot_, settings_, keep);
        const double a_v = contact_bound_3._0;
        const double a_omega = contact_bound_3._1;
        const double bound = contact_bound_3._2;
        if (!is_redundant((tuple_dd){a_v, a_omega}, bound, box)) {
            set_row(row_of(rows, count), (tuple_dd){a_v, a_omega}, bound, c.obstacle);
            count = count + 1;
        }
    }
    return count;
}

/* qpavoid.avoidance.barrier_rows: Fill in those of the wheels, ±v ± ω b/2 ≥ −w_max;
 * return how many. */
static int wheel_rows(vector robot_, matrix rows)
{
    const RobotLimits limits = limits_of(robot_);
    int count = 0;
    const double half = 0.5 * limits.track;
    const double most = limits.wheel_speed;
    const double among_2[] = {1.0, -1.0};
    for (int turn_1 = 0; turn_1 < 2; turn_1++) {
        const double forward = among_2[turn_1];
        const double among_4[] = {-1.0, 1.0};
        for (int turn_3 = 0; turn_3 < 2; turn_3++) {
            const double side = among_4[turn_3];
            if (most < INFINITY) {
                set_row(row_of(rows, count), (tuple_dd){forward, half * side}, -most,
                    -1);
                count = count + 1;
            }
        }
    }
    return count;
}

/* qpavoid.avoidance.lookahead: Return the rollout of a constant twist, a control step
 * beyond the horizon. */
static Rollout driven_on(const Scene *restrict scene, const Query *restrict query,
    tuple_dd twist)
{
    const filter_settings s = scene->settings;
    const Plan plan = hold(twist._0, twist._1, s->horizon + s->dt);
    return roll_out(scene, &plan, scene->last, 0.0, query->many);
}

/* qpavoid.avoidance.lookahead: Return when body i comes too near, if it does. */
static Meeting meeting_of(const Scene *restrict scene, const Rollout *restrict rollout,
    int i)
{
    const filter_settings s = scene->settings;
    const double end = moves(scene, i) ? s->horizon : s->horizon_still;
    double level = min2(body_at(scene, i).now, 0.0);
    double slack = 0.5 * tolerance(scene);
    if (level < -slack) {
        level = lowest(scene);
        slack = 0.0;
    }
    const tuple_bd too_near_1 = too_near(scene, rollout, i, (tuple_dd){0.0, end},
        level, slack);
    const bool near = too_near_1._0;
    const double time = too_near_1._1;
    return (Meeting){near ? i : -1, time};
}

/* qpavoid.avoidance.lookahead: Return the first violation along a rollout, in the order
 * of the bodies' rows. */
static Meeting first_near(const Scene *restrict scene, const Rollout *restrict rollout,
    int first)
{
    const filter_settings s = scene->settings;
    Meeting met = (Meeting){-1, 0.0};
    const matrix bodies = scene->bodies;
    const Watch watch = (Watch){(tuple_dd){s->horizon, 0.0},
        (tuple_dd){s->horizon_still, 0.0}};
    if (first >= 0) {
        met = meeting_of(scene, rollout, first);
    }
    int i = next_body(scene, rollout, 0, &watch);
    while (i < bodies.rows && (met.body < 0 || met.body != first)) {
        bool sooner = met.body < 0 || comes_first(bodies, i, met.body);
        if (met.body >= 0 && first >= 0) {
            const bool wraps = comes_first(bodies, i, first);
            if (wraps != comes_first(bodies, met.body, first)) {
                sooner = !wraps;
            }
        }
        if (sooner && i != first) {
            const Meeting found = meeting_of(scene, rollout, i);
            met = found.body >= 0 ? found : met;
        }
        i = next_body(scene, rollout, i + 1, &watch);
    }
    return met;
}

/* qpavoid.avoidance.broad_phase: Return when the first body that comes too near does,
 * in the order of their rows. */
static Meeting first_met(const Scene *restrict scene, const Rollout *restrict rollout,
    const Watch *restrict watch, double slack)
{
    Meeting met = (Meeting){-1, 0.0};
    int i = next_body(scene, rollout, 0, watch);
    while (i < scene->bodies.rows) {
        if (met.body < 0 || comes_first(scene->bodies, i, met.body)) {
            const tuple_dd moves_1 = moves(scene, i) ? watch->moving : watch->still;
            const double end = moves_1._0;
            const double level = moves_1._1;
            const tuple_bd too_near_2 = too_near(scene, rollout, i, (tuple_dd){0.0,
                end}, level, slack);
            const bool near = too_near_2._0;
            const double time = too_near_2._1;
            if (near) {
                met = (Meeting){i, time};
            }
        }
        i = next_body(scene, rollout, i + 1, watch);
    }
    return met;
}

/* qpavoid.avoidance.lookahead: Return (u − u')ᵀ W (u − u') of two twists, (m/s)². */
static double twist_cost(const Scene *restrict scene, tuple_dd one, tuple_dd other)
{
    const filter_settings s = scene->settings;
    const double d_v = one._0 - other._0;
    const double d_omega = one._1 - other._1;
    return s->weight_v * d_v * d_v + s->weight_omega * d_omega * d_omega;
}

/* qpavoid.avoidance.lookahead: Return the cost of the QP, (m/s)². */
static double cost_of(const Scene *restrict scene, const Query *restrict query, double
    v, double omega)
{
    return twist_cost(scene, (tuple_dd){v, omega}, query->desired);
}

/* qpavoid.avoidance.lookahead: Return the twist half-way to a candidate. */
static tuple_dd midpoint(tuple_dd twist, const Candidate2 *restrict best)
{
    return (tuple_dd){0.5 * (twist._0 + best->v), 0.5 * (twist._1 + best->omega)};
}

/* qpavoid.avoidance.linearisation: Return where the robot is at a tick, from the table
 * once it is known. */
static Frame frame_then(const Scene *restrict scene, const Rollout *restrict rollout,
    int k, matrix frames)
{
    const vector f = row_of(frames, k);
    const filter_settings s = scene->settings;
    if (f.at[2] > 1.0) {
        const Arc arc = arc_at(rollout->arcs, arc_index(rollout->arcs, 0, s->tick * k));
        const Frame at = frame_at(&arc, s->tick * k, s->dt);
        f.at[0] = at.x;
        f.at[1] = at.y;
        f.at[2] = at.cos;
        f.at[3] = at.sin;
    }
    return (Frame){f.at[0], f.at[1], f.at[2], f.at[3]};
}

/* qpavoid.avoidance.linearisation: Return in which eighth of the plane a direction
 * points, 0 to 7. */
static int sector(double n_x, double n_y)
{
    if (fabs(n_y) <= DIAGONAL * fabs(n_x)) {
        return n_x > 0.0 ? 0 : 4;
    }
    if (fabs(n_x) < DIAGONAL * fabs(n_y)) {
        return n_y > 0.0 ? 2 : 6;
    }
    if (n_x > 0.0) {
        return n_y > 0.0 ? 1 : 7;
    }
    return n_y > 0.0 ? 3 : 5;
}

/* qpavoid.avoidance.linearisation: Return a row of the table. */
static Side side_at(matrix sides, int row)
{
    const vector s = row_of(sides, row);
    return (Side){s.at[0], s.at[1], s.at[2], s.at[3], s.at[4], s.at[5], s.at[6]};
}

/* qpavoid.avoidance.linearisation: Write a row of the table. */
static void set_side(matrix sides, int row, const Side *restrict side)
{
    const vector s = row_of(sides, row);
    s.at[0] = side->x;
    s.at[1] = side->y;
    s.at[2] = side->n_x;
    s.at[3] = side->n_y;
    s.at[4] = side->room;
    s.at[5] = side->time;
    s.at[6] = side->body;
}

/* qpavoid.avoidance.linearisation: Keep the contact with a body at a time, if it is to
 * get a row; return its room. */
static double note_contact(const Scene *restrict scene, int i, const Body *restrict
    body, double time, const Frame *restrict at, matrix sides)
{
    double tick = 0;
    const Ends ends = ends_at(body, time, at);
    tick = scene->settings->tick;
    const Contact contact = line_contact(scene->edges, body, &ends);
    const double room = contact.distance - body->keep + max2(ROW_ROOM - body->now, 0.0);
    if (room < ROW_WITHIN) {
        const int slot = quotient(imax(whole(ceil(time / tick - SAME_TIME)) - 1, 0),
            STRIDE);
        const int row = slot * SECTORS + sector(contact.n_x, contact.n_y);
        const Side side = side_at(sides, row);
        if (room < side.room || (room == side.room && comes_first(scene->bodies, i,
            whole(side.body)))) {
            const double p_x = contact.x;
            const double p_y = contact.y;
            const double n_x = contact.n_x;
            const double n_y = contact.n_y;
            set_side(sides, row, (const Side[]){(Side){p_x, p_y, n_x, n_y, room, time,
                (double)i}});
        }
    }
    return room;
}

/* qpavoid.avoidance.linearisation: Fill in the contacts that get a row of the
 * linearisation. */
static void nearest_sides(const Scene *restrict scene, const Rollout *restrict rollout,
    const Tables *restrict tables)
{
    int k = 0;
    const filter_settings s = scene->settings;
    const matrix sides = tables->sides;
    const int end_2 = sides.rows;
    for (int row = 0; row < end_2; row++) {
        sides.at[row * sides.columns + ROOM_OF] = ROW_WITHIN;
    }
    const int end_4 = tables->frames.rows;
    for (int turn_3 = 0; turn_3 < end_4; turn_3++) {
        k = turn_3;
        tables->frames.at[k * tables->frames.columns + 2] = INFINITY;
    }
    const Watch watch = (Watch){(tuple_dd){s->horizon, ROW_WITHIN},
        (tuple_dd){s->horizon_still, ROW_WITHIN}};
    int i = next_body(scene, rollout, 0, &watch);
    while (i < scene->bodies.rows) {
        const Body body = body_at(scene, i);
        const double end = moves(scene, i) ? s->horizon : s->horizon_still;
        const int last = whole(rint(end / s->tick));
        k = 1;
        const double pace = s->tick * closing_speed(scene, rollout, &body) + TINY;
        const double passing = s->tick * passing_speed(scene, rollout, &body) + TINY;
        while (k <= last) {
            const double time = s->tick * k;
            const Frame at = frame_then(scene, rollout, k, tables->frames);
            double room = circle_room(scene, &body, time, &at);
            if (room > 2.0 * ROW_WITHIN) {
                k = k + (2 + whole(min2((room - ROW_WITHIN) / passing, last)));
                continue;
            }
            room = note_contact(scene, i, &body, time, &at, sides);
            k = k + (2 + whole(min2(fabs(room) / pace, last)));
        }
        i = next_body(scene, rollout, i + 1, &watch);
    }
}

/* qpavoid.avoidance.prediction: Write the slopes of an arc. */
static void set_slopes(matrix arcs, int row, const Slopes *restrict slopes)
{
    const vector a = row_of(arcs, row);
    a.at[SLOPES] = slopes->x_v;
    a.at[SLOPES + 1] = slopes->y_v;
    a.at[SLOPES + 2] = slopes->x_omega;
    a.at[SLOPES + 3] = slopes->y_omega;
    a.at[SLOPES + 4] = slopes->turn;
}

/* qpavoid.avoidance.linearisation: Return ∂(x, y)/∂ω of where (v, ω) leads in a time,
 * in the frame it leaves. */
static tuple_dd bend_by_turning(double v, double omega, double time)
{
    const double angle = omega * time;
    if (fabs(angle) < BARELY_TURNED) {
        return (tuple_dd){-v * omega * cube(time) / 3.0, 0.5 * v * square(time)};
    }
    const double cos_ = cos(angle);
    const double sin_ = sin(angle);
    const double x = (time * cos_ - sin_ / omega) / omega;
    const double y = (time * sin_ + (cos_ - 1.0) / omega) / omega;
    return (tuple_dd){v * x, v * y};
}

/* qpavoid.avoidance.linearisation: Return the slopes at a time on an arc from those
 * where it begins. */
static Slopes slopes_at(const Arc *restrict arc, const Slopes *restrict begin, double
    time, double dt)
{
    const double place = braking_place(time - arc->begin, arc->steps, dt);
    const double turn = begin->turn;
    const Frame one = moved_on((const Frame[]){(Frame){0.0, 0.0, 1.0, 0.0}}, 1.0,
        arc->omega, place);
    const tuple_dd bend_by_turning_1 = bend_by_turning(arc->v, arc->omega, place);
    const double b_x = bend_by_turning_1._0;
    const double b_y = bend_by_turning_1._1;
    const double l_x = arc->share_omega * b_x - turn * arc->v * one.y;
    const double l_y = arc->share_omega * b_y + turn * arc->v * one.x;
    return (Slopes){begin->x_v + arc->share_v * (arc->cos * one.x - arc->sin * one.y),
        begin->y_v + arc->share_v * (arc->sin * one.x + arc->cos * one.y), begin->x_omega +
        arc->cos * l_x - arc->sin * l_y, begin->y_omega + arc->sin * l_x + arc->cos * l_y,
        turn + arc->share_omega * place};
}

/* qpavoid.avoidance.linearisation: Fill in the slopes at the beginning of every arc. */
static void fill_slopes(const Rollout *restrict rollout, double dt)
{
    const matrix arcs = rollout->arcs;
    Slopes slopes = (Slopes){0.0, 0.0, 0.0, 0.0, 0.0};
    set_slopes(arcs, 0, &slopes);
    const int end_2 = arcs.rows;
    for (int row = 1; row < end_2; row++) {
        const double begin = arc_at(arcs, row).begin;
        slopes = slopes_at((const Arc[]){arc_at(arcs, row - 1)}, &slopes, begin, dt);
        set_slopes(arcs, row, &slopes);
    }
}

/* qpavoid.avoidance.prediction: Return how the beginning of an arc depends on the first
 * target. */
static Slopes slopes_of(matrix arcs, int row)
{
    const vector a = row_of(arcs, row);
    return (Slopes){a.at[SLOPES], a.at[SLOPES + 1], a.at[SLOPES + 2], a.at[SLOPES + 3],
        a.at[SLOPES + 4]};
}

/* qpavoid.avoidance.linearisation: Fill in the rows room + ∇d·(u − ū) ≥
 * :data:`ROW_ROOM`, in m; return how many. */
static int linearised_rows(const Scene *restrict scene, const Rollout *restrict rollout,
    Meeting met, const Tables *restrict tables)
{
    Arc arc = {0};
    Frame at = {0};
    double dt = 0;
    const matrix sides = tables->sides;
    const matrix rows = tables->rows;
    const tuple_dd about = rollout->target;
    nearest_sides(scene, rollout, tables);
    if (met.body >= 0) {
        arc = arc_at(rollout->arcs, arc_index(rollout->arcs, 0, met.time));
        at = frame_at(&arc, met.time, scene->settings->dt);
        const Body body = body_at(scene, met.body);
        note_contact(scene, met.body, &body, met.time, &at, sides);
    }
    fill_slopes(rollout, scene->settings->dt);
    const matrix arcs = rollout->arcs;
    dt = scene->settings->dt;
    int count = 0;
    const int end_2 = sides.rows;
    for (int i = 0; i < end_2; i++) {
        const Side side = side_at(sides, i);
        if (side.room >= ROW_WITHIN) {
            continue;
        }
        const int k = arc_index(arcs, 0, side.time);
        arc = arc_at(arcs, k);
        const double n_x = side.n_x;
        const double n_y = side.n_y;
        at = frame_at(&arc, side.time, dt);
        const Slopes slopes = slopes_at(&arc, (const Slopes[]){slopes_of(arcs, k)},
            side.time, dt);
        const double t_x = at.cos * n_x - at.sin * n_y;
        const double t_y = at.sin * n_x + at.cos * n_y;
        const double a_v = -t_x * slopes.x_v - t_y * slopes.y_v;
        double a_omega = (n_x * side.y - n_y * side.x) * slopes.turn;
        a_omega = a_omega - t_x * slopes.x_omega - t_y * slopes.y_omega;
        rows.at[count * rows.columns + A_V] = a_v;
        rows.at[count * rows.columns + A_OMEGA] = a_omega;
        rows.at[count * rows.columns + B] = a_v * about._0 + a_omega * about._1 +
            ROW_ROOM - side.room;
        rows.at[count * rows.columns + LINEARISATION_OWNER] = body_at(scene,
            whole(side.body)).owner;
        count = count + 1;
    }
    return count;
}

/* qpavoid.avoidance.lookahead: Return the answer of the QP that is linearised about a
 * rollout. */
static Optimum next_twist(const Scene *restrict scene, const Query *restrict query,
    const Rollout *restrict rollout, Meeting met)
{
    const filter_settings s = scene->settings;
    const int m = linearised_rows(scene, rollout, met, &query->tables);
    const Terms terms = (Terms){query->box, query->desired, (tuple_dd){s->weight_v,
        s->weight_omega}, 0};
    return solve_exactly(band(query->tables.rows, 0, m + 4), &terms, SLACK);
}

/* qpavoid.avoidance.lookahead: Return a local optimum near a start, by sequential
 * convexification. */
static Candidate2 nearest_ahead(const Scene *restrict scene, const Query *restrict
    query, tuple_dd start, double limit)
{
    tuple_dd twist = start;
    int where = -1;
    int halved = 0;
    bool settles = false;
    Candidate2 best = (Candidate2){0.0, 0.0, INFINITY};
    int tries = HOPELESS;
    if (limit == INFINITY) {
        tries = PATIENT;
    }
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        const Rollout rollout = driven_on(scene, query, twist);
        const Meeting met = first_near(scene, &rollout, where);
        if (met.body < 0) {
            halved = 0;
            const double cost = cost_of(scene, query, twist._0, twist._1);
            const bool gains = cost <= GAIN * best.cost;
            if (settles || gains) {
                best = (Candidate2){twist._0, twist._1, cost};
            }
            if (settles || !(gains || limit == INFINITY)) {
                break;
            }
            if (!gains) {
                settles = true;
                twist = midpoint(twist, &best);
                continue;
            }
        } else if (best.cost < INFINITY && halved < HALVINGS) {
            halved = halved + 1;
            where = met.body;
            twist = midpoint(twist, &best);
            continue;
        } else if (best.cost < INFINITY || iteration >= tries) {
            break;
        }
        const tuple_dd before = twist;
        where = met.body;
        const Optimum solved = next_twist(scene, query, &rollout, met);
        twist = (tuple_dd){solved.v, solved.omega};
        const double moved = fabs(twist._0 - before._0) + fabs(twist._1 - before._1);
        if (!solved.found || (met.body < 0 && moved < UNMOVED)) {
            break;
        }
        const double dearest = met.body < 0 ? limit : DEAR * limit;
        if (cost_of(scene, query, twist._0, twist._1) > dearest) {
            break;
        }
    }
    return best;
}

/* qpavoid.avoidance.lookahead: Return where the pivot of a body is at a time, as seen
 * from a frame. */
static tuple_dd seen_from(const Frame *restrict at, const Body *restrict body, double
    time)
{
    const double d_x = body->x + time * body->v_x - at->x;
    const double d_y = body->y + time * body->v_y - at->y;
    return (tuple_dd){at->cos * d_x + at->sin * d_y, at->cos * d_y - at->sin * d_x};
}

/* qpavoid.avoidance.lookahead: Return whether a robot at rest at the horizon lets every
 * moving body pass. */
static bool lets_pass(const Scene *restrict scene, const Rollout *restrict rollout)
{
    const filter_settings s = scene->settings;
    const int last = rollout->arcs.rows - 1;
    const Frame at = frame_at((const Arc[]){arc_at(rollout->arcs, last)}, s->horizon,
        s->dt);
    const int end_2 = scene->bodies.rows;
    for (int i = 0; i < end_2; i++) {
        const Body body = body_at(scene, i);
        const double speed = sqrt(square(body.v_x) + square(body.v_y));
        if (speed > 0.0) {
            const tuple_dd seen_from_3 = seen_from(&at, &body, s->horizon);
            const double x1 = seen_from_3._0;
            const double y1 = seen_from_3._1;
            const tuple_dd seen_from_4 = seen_from(&at, &body, s->horizon + PASSING /
                speed);
            const double x2 = seen_from_4._0;
            const double y2 = seen_from_4._1;
            const Contact swept = wall_contact(scene->edges, (const
                Segment[]){(Segment){x1, y1, x2, y2}});
            if (swept.distance < body.keep) {
                return false;
            }
        }
    }
    return true;
}

/* qpavoid.avoidance.lookahead: Return the twist near the start that keeps its distance
 * and lets others pass. */
static Candidate2 refine_candidate(const Scene *restrict scene, const Query *restrict
    query, tuple_dd start, double limit)
{
    const Candidate2 found = nearest_ahead(scene, query, start, limit);
    if (found.cost >= limit) {
        return found;
    }
    for (int quarter = 0; quarter < 5; quarter++) {
        const double share = 0.25 * quarter;
        const double v = found.v + share * (start._0 - found.v);
        const double omega = found.omega + share * (start._1 - found.omega);
        const Rollout rollout = driven_on(scene, query, (tuple_dd){v, omega});
        if (!lets_pass(scene, &rollout)) {
            continue;
        }
        if (quarter == 0) {
            return found;
        }
        if (first_near(scene, &rollout, -1).body < 0) {
            return (Candidate2){v, omega, cost_of(scene, query, v, omega)};
        }
    }
    return (Candidate2){found.v, found.omega, IN_THE_WAY * found.cost};
}

/* qpavoid.avoidance.target: Return one of the starts; of a pair the one to the right
 * comes first. */
static tuple_dd start_twist(const Query *restrict query, int group, int member)
{
    const Box box = query->box;
    if (group == 1) {
        return member == 0 ? query->desired : (tuple_dd){0.0, 0.0};
    }
    const double v = group == 0 ? box.v_max : box.v_min;
    if (group == 2) {
        return (tuple_dd){member == 0 ? box.v_min : box.v_max, 0.0};
    }
    return (tuple_dd){v, member == 0 ? box.omega_min : box.omega_max};
}

/* qpavoid.avoidance.target: Return what it costs to change over from the target so far,
 * (m/s)². */
static double change_cost(const Scene *restrict scene, vector state, const Candidate2
    *restrict found)
{
    if (state.at[TARGET_MODE] == FREE) {
        return 0.0;
    }
    const tuple_dd target = first_target(scene, (const Plan[]){kept_plan(state)});
    return twist_cost(scene, (tuple_dd){found->v, found->omega}, target);
}

/* qpavoid.avoidance.target: Return the constant twist that keeps its distance at least
 * cost. */
static Candidate2 best_candidate(const Scene *restrict scene, const Query *restrict
    query, vector state)
{
    const filter_settings s = scene->settings;
    Candidate2 best = (Candidate2){0.0, 0.0, INFINITY};
    int due = any_moves(scene) ? GROUPS : quotient(GROUPS, 2);
    if (state.at[TARGET_MODE] != FREE) {
        const tuple_dd target = first_target(scene, (const Plan[]){kept_plan(state)});
        best = refine_candidate(scene, query, target, INFINITY);
        if (best.cost < INFINITY) {
            best = (Candidate2){best.v, best.omega, best.cost * (1.0 - s->hysteresis)};
            state.at[TARGET_DUE] = state.at[TARGET_DUE] - 1.0;
            due = state.at[TARGET_DUE] >= 0.0 ? 0 : 1;
        } else if (state.at[TARGET_MODE] >= NEW_PLAN) {
            due = 1;
        }
    }
    if (best.cost == INFINITY || due > 0) {
        state.at[TARGET_DUE] = whole(floor(s->review / (GROUPS * s->dt)));
    }
    if (best.cost < CHEAP) {
        return best;
    }
    const int end_2 = due;
    for (int turn_1 = 0; turn_1 < end_2; turn_1++) {
        const int group = whole(state.at[TARGET_GROUP]);
        const double limit = best.cost;
        state.at[TARGET_GROUP] = fmodulo(state.at[TARGET_GROUP] + 1.0, GROUPS);
        for (int member = 0; member < 2; member++) {
            const tuple_dd start = start_twist(query, group, member);
            const Candidate2 found = refine_candidate(scene, query, start, limit);
            const double cost = found.cost + s->hysteresis * change_cost(scene, state,
                &found);
            if (cost < best.cost * (1.0 - RELATIVE_ROUNDING)) {
                best = (Candidate2){found.v, found.omega, cost};
            }
        }
    }
    return best;
}

/* qpavoid.avoidance.target: Return whether the last plan costs less than the best
 * candidate, if any. */
static bool is_dearer(const Scene *restrict scene, const Query *restrict query, const
    Candidate2 *restrict best, vector state)
{
    const filter_settings s = scene->settings;
    if (state.at[TARGET_MODE] == FREE || state.at[UNTIL] < s->horizon - s->review) {
        return false;
    }
    const tuple_dd first_target_1 = first_target(scene, (const
        Plan[]){kept_plan(state)});
    const double v = first_target_1._0;
    const double omega = first_target_1._1;
    const double cost = cost_of(scene, query, best->v, best->omega);
    const double limit = (1.0 + s->hysteresis) * cost_of(scene, query, v, omega) +
        CHEAP;
    return best->cost == INFINITY || cost > limit;
}

/* qpavoid.avoidance.target: Return whether anything is left of the last plan but to
 * brake. */
static bool has_plan(const Scene *restrict scene, vector state)
{
    return state.at[END] > 0.5 * scene->settings->dt && !is_inexact(scene);
}

/* qpavoid.avoidance.target: Return whether the rest of the last plan keeps clear for as
 * long as it did. */
static bool carries_on(const Scene *restrict scene, vector state)
{
    const double until = min2(state.at[UNTIL], scene->settings->horizon);
    const Plan kept = kept_plan(state);
    if (until == 0.0 || !has_plan(scene, state)) {
        return false;
    }
    return keeps_clear(scene, &kept, first_twist(scene, &kept), until);
}

/* qpavoid.avoidance.plans: Return the cost of a plan: see :class:`Found`. */
static double plan_cost(const Scene *restrict scene, const Query *restrict query, const
    Plan *restrict plan)
{
    const double cost = cost_of(scene, query, plan->v, plan->omega);
    return cost + 0.1 * cost_of(scene, query, plan->v_then, plan->omega_then);
}

/* qpavoid.avoidance.plans: Return the room that counts, m: in whole :data:`ALIKE`, up
 * to what is plenty. */
static double worth(double room)
{
    return ALIKE * floor(min2(room, PLENTY) / ALIKE);
}

/* qpavoid.avoidance.plans: Return the room that a body must leave to a plan, m. */
static double level_of(const Scene *restrict scene, int i, double level)
{
    return moves(scene, i) ? level : lowest(scene);
}

/* qpavoid.avoidance.plans: Evaluate a plan, as far as it can be better than the best so
 * far. */
static Found looked_at(const Scene *restrict scene, const Query *restrict query, const
    Plan *restrict plan, const Found *restrict best, const Found *restrict last)
{
    const double cost = plan_cost(scene, query, plan);
    const int body = last->body;
    const double time = last->time;
    const Found failed = (Found){(*plan), NO_ROOM, cost, body, time};
    const double level = worth(best->room);
    if (best->room >= PLENTY && cost > best->cost) {
        return failed;
    }
    const Rollout rollout = roll_out(scene, plan, scene->last, 0.0, query->many);
    if (body >= 0 && room_at(scene, &rollout, body, time) < level_of(scene, body,
        level)) {
        return failed;
    }
    const tuple_dd moving = (tuple_dd){scene->settings->horizon, level};
    const tuple_dd still = (tuple_dd){rollout.rest, lowest(scene)};
    Meeting met = first_met(scene, &rollout, (const Watch[]){(Watch){moving,
        (tuple_dd){-1.0, 0.0}}}, ALIKE);
    if (met.body < 0) {
        met = first_met(scene, &rollout, (const Watch[]){(Watch){(tuple_dd){-1.0, 0.0},
            still}}, ALIKE);
    }
    if (met.body >= 0) {
        return (Found){(*plan), NO_ROOM, cost, met.body, met.time};
    }
    return (Found){(*plan), moving_room(scene, &rollout, MOST_ROOM), cost, body, time};
}

/* qpavoid.avoidance.plans: Return one of the nine twists of which either part is least,
 * 0 or greatest. */
static tuple_dd extreme(const Box *restrict box, int number)
{
    const double v = ((const double[]){box->v_min, 0.0, box->v_max})[quotient(number, 3)];
    return (tuple_dd){v, ((const double[]){box->omega_min, 0.0,
        box->omega_max})[modulo(number, 3)]};
}

/* qpavoid.avoidance.plans: Return one of twenty-five twists, five by five from limit to
 * limit. */
static tuple_dd evenly(const Box *restrict box, int number)
{
    const double v = box->v_min + 0.25 * quotient(number, 5) * (box->v_max - box->v_min);
    const double width = box->omega_max - box->omega_min;
    return (tuple_dd){v, box->omega_min + 0.25 * modulo(number, 5) * width};
}

/* qpavoid.avoidance.plans: Return whether a plan is worth more, or costs less, or has
 * more room. */
static bool is_better(const Found *restrict one, const Found *restrict other)
{
    if (worth(one->room) != worth(other->room)) {
        return one->room > other->room;
    }
    if (one->cost != other->cost) {
        return one->cost < other->cost;
    }
    return one->room > other->room;
}

/* qpavoid.avoidance.plans: Return when something comes nearer than a level first, s; at
 * most ``end``. */
static double time_until_near(const Scene *restrict scene, const Rollout *restrict
    rollout, double level, double end)
{
    const Watch watch = (Watch){(tuple_dd){end, level}, (tuple_dd){end,
        lowest(scene)}};
    int i = next_body(scene, rollout, 0, &watch);
    while (i < scene->bodies.rows) {
        const tuple_bd too_near_1 = too_near(scene, rollout, i, (tuple_dd){0.0, end},
            level_of(scene, i, level), ALIKE);
        end = too_near_1._1;
        i = next_body(scene, rollout, i + 1, &watch);
    }
    return end;
}

/* qpavoid.avoidance.plans: Return the plan of two extreme twists with the most room. */
static Found best_plan(const Scene *restrict scene, const Query *restrict query, const
    Plan *restrict kept, int share)
{
    Plan plan = {0};
    tuple_dd twist = {0};
    const Box box = query->box;
    const filter_settings s = scene->settings;
    bool anew = false;
    const Found nothing = (Found){(*kept), NOTHING_YET, INFINITY, -1, 0.0};
    const Found first = looked_at(scene, query, kept, &nothing, &nothing);
    Found best = (Found){(*kept), first.room + BETTER, first.cost, -1, 0.0};
    Found last = first;
    const int end_2 = 9 + 25;
    for (int i = 0; i < end_2; i++) {
        twist = i < 9 ? extreme(&box, i) : evenly(&box, i - 9);
        plan = hold(twist._0, twist._1, s->horizon);
        last = looked_at(scene, query, &plan, &best, &last);
        if (is_better(&last, &best)) {
            best = last;
            anew = true;
        }
    }
    for (int i = 0; i < 9; i++) {
        if (share > 0 && quotient(i, 3) != share - 1) {
            continue;
        }
        twist = extreme(&box, i);
        plan = hold(twist._0, twist._1, s->horizon);
        const Rollout rollout = roll_out(scene, &plan, scene->last, 0.0, query->many);
        const double level = worth(best.room);
        const double latest = time_until_near(scene, &rollout, level, s->horizon);
        const double among_5[] = {1.6, 1.1, 0.7, 0.4, 0.2, 0.1};
        for (int turn_4 = 0; turn_4 < 6; turn_4++) {
            const double switch_ = among_5[turn_4];
            if (switch_ > latest) {
                continue;
            }
            for (int j = 0; j < 9; j++) {
                const tuple_dd then = extreme(&box, j);
                if (j == i) {
                    continue;
                }
                plan = (Plan){twist._0, twist._1, switch_, then._0, then._1,
                    s->horizon};
                last = looked_at(scene, query, &plan, &best, &last);
                if (is_better(&last, &best)) {
                    best = last;
                    anew = true;
                }
            }
        }
    }
    return anew ? best : first;
}

/* qpavoid.avoidance.plans: Return whether a plan has :data:`NO_ROOM`, whatever was
 * added to that. */
static bool is_refused(const Found *restrict found)
{
    return !(found->room > 0.5 * NO_ROOM);
}

/* qpavoid.avoidance.target: Return whether braking keeps clear for as long as the last
 * plan did. */
static bool braking_keeps_clear(const Scene *restrict scene, vector state)
{
    const filter_settings s = scene->settings;
    const tuple_dd twist = first_twist(scene, (const Plan[]){hold(0.0, 0.0, 0.0)});
    const double until = min2(state.at[UNTIL], s->horizon);
    const Plan plan = hold(twist._0, twist._1, s->dt);
    return until > 0.0 && keeps_clear(scene, &plan, twist, until);
}

/* qpavoid.avoidance.target: Return a plan of two twists. */
static Target plan_anew(const Scene *restrict scene, const Query *restrict query, vector
    state, int owner)
{
    double horizon = 0;
    horizon = scene->settings->horizon;
    Plan kept = kept_plan(state);
    if (!has_plan(scene, state)) {
        kept = hold(0.0, 0.0, horizon);
    }
    if (!any_moves(scene)) {
        return (Target){kept, STUCK, 0.0, owner};
    }
    const Found found = best_plan(scene, query, &kept, whole(state.at[TARGET_SHARE]));
    const tuple_dd twist = first_twist(scene, &found.plan);
    const Rollout rollout = exact_rollout(scene, &found.plan, twist);
    const double level = lowest(scene);
    double room = 0.0;
    const bool clear = keeps_all(scene, &rollout, (const
        Watch[]){(Watch){(tuple_dd){horizon, level}, (tuple_dd){-1.0, 0.0}}});
    if (!clear) {
        room = min2(moving_room(scene, &rollout, 0.0), 2.0 * level);
    }
    bool drivable = !is_refused(&found) && keeps_from_standing(scene, &rollout, level);
    drivable = drivable && (!is_inexact(scene) || may_brake(scene, twist));
    if (!drivable || !(clear || !braking_keeps_clear(scene, state))) {
        return (Target){kept, STUCK, NO_ROOM, owner};
    }
    return (Target){found.plan, NEW_PLAN, room, owner};
}

/* qpavoid.avoidance.target: Return what to aim at, in this order: as desired, round,
 * carried on, planned. */
static Target look_ahead(const Scene *restrict scene, const Query *restrict query,
    vector state)
{
    double end = 0;
    const filter_settings s = scene->settings;
    const double v = query->desired._0;
    const double omega = query->desired._1;
    Plan plan = hold(v, omega, s->horizon + s->dt);
    Rollout rollout = driven_on(scene, query, query->desired);
    int body = first_near(scene, &rollout, -1).body;
    if (body < 0) {
        end = clear_end(scene, query->desired, first_twist(scene, &plan), 0.0);
        if (end > 0.0) {
            return (Target){hold(v, omega, end), FREE, 0.0, -1};
        }
        rollout = exact_rollout(scene, &plan, first_twist(scene, &plan));
        const double level = lowest(scene);
        const Watch watch = (Watch){(tuple_dd){s->horizon, level},
            (tuple_dd){rollout.rest, level}};
        body = first_met(scene, &rollout, &watch, 0.0).body;
    }
    const int owner = body >= 0 ? whole(body_at(scene, body).owner) : -1;
    const Candidate2 best = best_candidate(scene, query, state);
    const bool goes_on = is_dearer(scene, query, &best, state) && carries_on(scene,
        state);
    if (best.cost < INFINITY && !goes_on) {
        plan = hold(best.v, best.omega, s->horizon);
        const tuple_dd twist = (tuple_dd){best.v, best.omega};
        end = clear_end(scene, twist, first_twist(scene, &plan), 0.0);
        if (end > 0.0) {
            return (Target){hold(best.v, best.omega, end), ROUND, 0.0, owner};
        }
    }
    if (goes_on || (best.cost < INFINITY && carries_on(scene, state))) {
        return (Target){kept_plan(state), CARRIED, 0.0, owner};
    }
    return plan_anew(scene, query, state, owner);
}

/* qpavoid.avoidance.target: Return whether there is anything that stands, and wants
 * more than ``closest``. */
static bool may_come_closer(const Scene *restrict scene)
{
    double closest = 0;
    closest = scene->settings->closest;
    const int end_2 = scene->bodies.rows;
    for (int i = 0; i < end_2; i++) {
        const Body body = body_at(scene, i);
        if (!moves(scene, i) && body.keep - body.inflation > closest) {
            return true;
        }
    }
    return false;
}

/* qpavoid.avoidance.target: Return what to aim at nearer to what stands; the same where
 * that is no better. */
static Target come_closer(const Scene *restrict scene, const Query *restrict query,
    vector state, const Target *restrict target)
{
    double closest = 0;
    double room = target->room;
    if (target->mode == STUCK) {
        const tuple_dd brake = first_twist(scene, (const Plan[]){hold(0.0, 0.0, 0.0)});
        room = moving_room(scene, (const Rollout[]){rollout_to_rest(scene, brake)},
            0.0);
    }
    if (room >= -scene->settings->r_min_slow || !may_come_closer(scene)) {
        return (*target);
    }
    closest = scene->settings->closest;
    const Scene nearer = altered(scene, scene->bodies, scene->drift, closest);
    const Target other = look_ahead(&nearer, query, state);
    const Rollout rollout = exact_rollout(scene, &other.plan, first_twist(scene,
        &other.plan));
    const double gained = moving_room(scene, &rollout, 0.0);
    if (other.mode == STUCK || gained <= room + ALIKE) {
        return (*target);
    }
    room = standing_room(scene, &rollout, gained);
    const double mode = other.mode == CARRIED ? CARRIED : NEW_PLAN;
    return (Target){other.plan, mode, room, other.owner};
}

/* qpavoid.avoidance.target: Return what to aim at; where that meets what moves, nearer
 * to what stands. */
static Target choose_target(const Scene *restrict scene, const Query *restrict query,
    vector state)
{
    Target target = look_ahead(scene, query, state);
    if (target.mode == NEW_PLAN || target.mode == STUCK) {
        target = come_closer(scene, query, state, &target);
    }
    state.at[TARGET_MODE] = target.mode;
    if (target.mode == ROUND) {
        state.at[TARGET_SHARE] = 0.0;
    } else if (target.mode == NEW_PLAN || target.mode == STUCK) {
        state.at[TARGET_SHARE] = fmodulo(state.at[TARGET_SHARE], SHARES) + 1.0;
    }
    return target;
}

/* qpavoid.avoidance.step: Return what is left of the way to the first target of a plan
 * after a twist. */
static tuple_dd left_after(const Scene *restrict scene, const Plan *restrict plan,
    tuple_dd twist)
{
    const double half = 0.5 * scene->settings->dt;
    if (plan->switch_ < half || plan->end < half) {
        return (tuple_dd){0.0, 0.0};
    }
    return (tuple_dd){plan->v - twist._0, plan->omega - twist._1};
}

/* qpavoid.avoidance.step: Add the rows of the last linearisation, about the target, as
 * hard ones. */
static int add_ahead(const Scene *restrict scene, const Target *restrict target, const
    Query *restrict query, matrix rows)
{
    const tuple_dd anchor = first_twist(scene, &target->plan);
    const Plan plan = target->plan;
    const Rollout rollout = driven_on(scene, query, (tuple_dd){plan.v, plan.omega});
    const Tables tables = (Tables){query->tables.sides, rows, query->tables.frames};
    const int count = linearised_rows(scene, &rollout, (Meeting){-1, 0.0}, &tables);
    const int end_2 = count;
    for (int i = 0; i < end_2; i++) {
        const double a_v = rows.at[i * rows.columns + A_V];
        const double a_omega = rows.at[i * rows.columns + A_OMEGA];
        const double has = a_v * anchor._0 + a_omega * anchor._1 - ROW_ROUNDING;
        const double b = rows.at[i * rows.columns + B] - a_v * (plan.v - anchor._0) -
            a_omega * (plan.omega - anchor._1);
        rows.at[i * rows.columns + B] = min2(b, has);
    }
    return count;
}

/* qpavoid.avoidance.step: Look round and ahead, and write the QP; invalid data leave
 * ``state`` as it is. */
static Prepared prepare(const Setup *restrict setup, const Request *restrict request,
    vector state, vector memory)
{
    Scene scene = {0};
    const tuple_dd new_1 = (tuple_dd){state.at[0], state.at[1]};
    const matrix edges_ = setup->edges;
    const vector robot_ = setup->robot;
    const filter_settings settings_ = setup->settings;
    const tuple_dd last = new_1;
    tuple_mm obstacles = request->obstacles;
    const double age = request->age;
    bool ahead = request->ahead;
    const tuple_dd desired = request->desired;
    const filter_settings s = settings_;
    const int most = most_contacts(edges_, &obstacles);
    int code = WORKSPACE_TOO_SMALL;
    double clearance = INFINITY;
    int m = 0;
    int n_hard = 0;
    ahead = ahead && (int)s->bound == BARRIER;
    const Box box = twist_box(robot_, last._0, last._1, s->dt);
    const tuple_dd wish = clipped(desired, (const Box[]){(Box){-GREATEST, GREATEST,
        -GREATEST, GREATEST}});
    const bool fits = memory.rows >= memory_size(most, settings_);
    const Workspace space = carve(memory, fits ? most : 0, settings_);
    if (fits) {
        obstacles = seen_then(setup, &obstacles, state, &space);
        const double reach = row_reach(robot_, settings_, obstacles._1, age);
        const double radius = limits_of(robot_).circumradius;
        code = READY;
        const tuple_ii contact_table_2 = contact_table(edges_, radius, &obstacles,
            reach, space.contacts);
        const int n = contact_table_2._0;
        const int nearest = contact_table_2._1;
        if (nearest == -2 || !(isfinite(desired._0) && isfinite(desired._1))) {
            code = INVALID;
        } else {
            clearance = nearest_distance(space.contacts, nearest);
            m = constraint_rows(band(space.contacts, 0, n), robot_, settings_, &box,
                age, ahead, space.rows);
            n_hard = wheel_rows(robot_, band(space.rows, m, space.rows.rows));
            m = m + n_hard;
        }
    }
    int count = 0;
    if (code == READY && (int)s->bound == BARRIER) {
        scene = new_scene(setup, state, &space, most);
        count = bodies_in_reach(&scene, &obstacles, age, ahead ? s->horizon : 0.0);
    }
    scene = new_scene(setup, state, &space, count);
    tuple_dd anchor = braking_twist(robot_, last._0, last._1, s->dt);
    tuple_dd rest = (tuple_dd){0.0, 0.0};
    Target target = (Target){hold(anchor._0, anchor._1, s->dt), FREE, 0.0, -1};
    if (code == READY && ahead) {
        const Box limits = look_box(robot_);
        const int many = imax(1, whole(rint(s->tick / s->dt)));
        const Query query = (Query){limits, clipped(wish, &limits), many, space.tables};
        target = choose_target(&scene, &query, state);
        anchor = first_twist(&scene, &target.plan);
        rest = left_after(&scene, &target.plan, anchor);
        if (target.mode == ROUND) {
            const int more = add_ahead(&scene, &target, &query, band(space.rows, m,
                space.rows.rows));
            m = m + more;
            n_hard = n_hard + more;
        }
    }
    return (Prepared){code, clearance, most, count, m, n_hard, last, box, wish,
        (tuple_dd){wish._0 - rest._0, wish._1 - rest._1}, rest, anchor, target, ahead};
}

/* qpavoid.avoidance.step: Return the decision of one control step, and bring ``state``
 * up to date. */
static Outcome filter_outcome(const Setup *restrict setup, const Request *restrict
    request, vector state, vector memory)
{
    const Prepared prepared = prepare(setup, request, state, memory);
    Outcome outcome = unsolved(prepared.code, (tuple_dd){0.0, 0.0}, 0.0);
    tuple_dd rejected = prepared.anchor;
    const tuple_dd none = (tuple_dd){INFINITY, INFINITY};
    const int end_2 = prepared.code == READY ? attempts(&prepared) + 1 : 0;
    for (int attempt = 0; attempt < end_2; attempt++) {
        outcome = decide(setup, &prepared, memory, attempt, rejected, none, state);
        if (outcome.code != AGAIN) {
            break;
        }
        rejected = (tuple_dd){outcome.v, outcome.omega};
    }
    return outcome;
}

/* qpavoid.avoidance.step: Do :func:`filter_outcome`, for Python. */
static tuple_iddddddii filter_step(matrix edges_, vector robot_, filter_settings
    settings_, matrix points, matrix capsules, double age, bool ahead, double v, double
    omega, vector state, vector memory)
{
    const Setup setup = (Setup){edges_, robot_, settings_};
    const Request request = (Request){(tuple_mm){points, capsules}, age, ahead,
        (tuple_dd){v, omega}};
    const Outcome o = filter_outcome(&setup, &request, state, memory);
    return (tuple_iddddddii){o.code, o.v, o.omega, o.clearance, o.slack, o.residual,
        o.shortfall, o.first, o.second};
}

/* qpavoid.lab.simulation.clearance: Return how fast a distance can shrink while (v, ω)
 * is driven, m/s. */
static double greatest_pace(vector robot_, double v, double omega, double fastest)
{
    return fabs(v) + fabs(omega) * limits_of(robot_).circumradius + fastest;
}

/* qpavoid.model.kinematics: Return the pose after ``dt`` of a base that also moves to
 * its left, m/s. */
static tuple_ddd integrate(const tuple_ddd *restrict pose, tuple_dd twist, double
    lateral, double dt)
{
    const double heading = pose->_2;
    const double omega = twist._1;
    const tuple_ddd arc_1 = arc(pose->_0, pose->_1, heading, twist._0, omega, dt);
    double x = arc_1._0;
    double y = arc_1._1;
    const double after = arc_1._2;
    if (lateral != 0.0) {
        const tuple_ddd arc_2 = arc(x, y, heading + 0.5 * 3.141592653589793, lateral,
            omega, dt);
        x = arc_2._0;
        y = arc_2._1;
    }
    return (tuple_ddd){x, y, after};
}

/* qpavoid.lab.simulation.outcome: Return whether nothing more is expected to happen. */
static bool is_over(double time, double quiet, loop_outcome outcome, double settled)
{
    return time > max2(quiet, outcome->arrived + settled);
}

/* qpavoid.lab.simulation.outcome: Write the errors at the goal, and since when they
 * have been small enough. */
static void note_arrival(loop_outcome outcome, const Goal2 *restrict goal, const
    tuple_ddd *restrict pose, double time)
{
    const double x = pose->_0;
    const double y = pose->_1;
    const double heading = pose->_2;
    const double x_goal = goal->pose._0;
    const double y_goal = goal->pose._1;
    const double heading_goal = goal->pose._2;
    const loop_outcome o = outcome;
    const double error = sqrt(square(x - x_goal) + square(y - y_goal));
    const double heading_error = fabs(wrap_angle(heading - heading_goal));
    if (error > goal->near || heading_error > goal->aligned) {
        o->arrived = INFINITY;
    } else if (o->arrived == INFINITY) {
        o->arrived = time;
    }
    o->error = error;
    o->heading_error = heading_error;
}

/* qpavoid.avoidance.repulsion: Return code and what Eq. 5 or 7 adds to the desired
 * twist at a contact. */
static tuple_idd repulsive_twist(int law, const Setup *restrict setup, const
    ObstacleContact *restrict contact, const Request *restrict request)
{
    double push_omega = 0;
    double push_v = 0;
    const filter_settings s = setup->settings;
    const ObstacleContact c = (*contact);
    const double age = request->age;
    const double v = request->desired._0;
    const double omega = request->desired._1;
    double speed = sqrt(c.v_x * c.v_x + c.v_y * c.v_y);
    const tuple_dd wanted_distance_1 = wanted_distance(setup->settings, speed, age);
    const double r_min = wanted_distance_1._0;
    double wanted = wanted_distance_1._1;
    const tuple_dd approach_row_2 = approach_row(c.x, c.y, c.n_x, c.n_y);
    const double a_v = approach_row_2._0;
    const double a_omega = approach_row_2._1;
    const double closing = -(a_v * v + a_omega * omega + c.n_x * c.v_x + c.n_y * c.v_y);
    wanted = wanted + s->closing_gain * max2(closing, 0.0);
    const double r = wanted + (s->zone_ratio - 1.0) * r_min;
    speed = s->speed * activation((int)s->activation, c.distance, wanted, r);
    if (speed == 0.0) {
        return (tuple_idd){TRACKING, 0.0, 0.0};
    }
    double lever = c.x;
    if (law == 5) {
        const tuple_dd eq5_3 = eq5(c.x, c.y, c.n_x, c.n_y, speed, s->damping);
        push_v = eq5_3._0;
        push_omega = eq5_3._1;
    } else {
        const Edge edge = edge_at(setup->edges, c.segment);
        lever = c.y * edge.n_x - c.x * edge.n_y;
        const tuple_dd eq7_4 = eq7(c.x, c.y, edge.n_x, edge.n_y, speed, s->damping);
        push_v = eq7_4._0;
        push_omega = eq7_4._1;
    }
    if (fabs(lever) + s->damping < SINGULAR_LEVER) {
        return (tuple_idd){SINGULAR, 0.0, 0.0};
    }
    return (tuple_idd){REPELLED, push_v, push_omega};
}

/* qpavoid.avoidance.repulsion: Return the outcome of Eq. 5 or Eq. 7. */
static Outcome repulsion_step(int law, const Setup *restrict setup, const Request
    *restrict request, vector state, matrix contacts)
{
    double v = request->desired._0;
    double omega = request->desired._1;
    const vector robot_ = setup->robot;
    if (!(isfinite(v) && isfinite(omega))) {
        return unsolved(INVALID, (tuple_dd){0.0, 0.0}, 0.0);
    }
    const double radius = limits_of(robot_).circumradius;
    const tuple_ii contact_table_1 = contact_table(setup->edges, radius,
        &request->obstacles, 0.0, contacts);
    const int nearest = contact_table_1._1;
    if (nearest == -2) {
        return unsolved(INVALID, (tuple_dd){0.0, 0.0}, 0.0);
    }
    int code = TRACKING;
    double push_v = 0.0;
    double push_omega = 0.0;
    double distance = INFINITY;
    int obstacle = -1;
    if (nearest >= 0) {
        const ObstacleContact contact = contact_at(contacts, nearest);
        distance = contact.distance;
        const tuple_idd repulsive_twist_2 = repulsive_twist(law, setup, &contact,
            request);
        code = repulsive_twist_2._0;
        push_v = repulsive_twist_2._1;
        push_omega = repulsive_twist_2._2;
        obstacle = code != TRACKING ? contact.obstacle : -1;
    }
    const tuple_dd wanted = (tuple_dd){v + push_v, omega + push_omega};
    const tuple_dd last = (tuple_dd){state.at[0], state.at[1]};
    const tuple_dd limit_twist_3 = limit_twist(robot_, wanted, last,
        setup->settings->dt);
    v = limit_twist_3._0;
    omega = limit_twist_3._1;
    state.at[0] = v;
    state.at[1] = omega;
    return (Outcome){code, v, omega, distance, 0.0, 0.0, 0.0, obstacle, -1};
}

/* qpavoid.lab.simulation.clearance: Return the least distance, and the least distance
 * less r_min(v_o), at a pose, m. */
static tuple_dd room_round(const Setup *restrict setup, const Motion *restrict motion,
    const View *restrict view, double most)
{
    const matrix edges_ = setup->edges;
    const vector robot_ = setup->robot;
    const filter_settings settings_ = setup->settings;
    const tuple_mm seen = view->seen;
    const matrix contacts = view->contacts;
    in_robot_frame(&motion->pose, motion->time, &view->world, &seen);
    const double reach = most + settings_->r_min_fast;
    const tuple_ii contact_table_1 = contact_table(edges_,
        limits_of(robot_).circumradius, &seen, reach, contacts);
    const int n = contact_table_1._0;
    double least = INFINITY;
    double room = INFINITY;
    const int end_3 = n;
    for (int k = 0; k < end_3; k++) {
        const ObstacleContact c = contact_at(contacts, k);
        const double speed = sqrt(c.v_x * c.v_x + c.v_y * c.v_y);
        const tuple_dd wanted_distance_4 = wanted_distance(settings_, speed, 0.0);
        const double r_min = wanted_distance_4._0;
        least = min2(least, c.distance);
        room = min2(room, c.distance - r_min);
    }
    return (tuple_dd){least, room};
}

/* qpavoid.lab.simulation.clearance: Return what :func:`room_round` does, the least
 * along the arc of a control step. */
static tuple_dd room_on_the_way(const Setup *restrict setup, const Motion *restrict
    motion, const View *restrict view, double most)
{
    double dt = 0;
    dt = setup->settings->dt;
    const tuple_ddd start = motion->pose;
    const tuple_dd twist = motion->twist;
    const double lateral = motion->lateral;
    const double time = motion->time;
    const double pace = motion->pace;
    double least = INFINITY;
    const int looks = imax(1, whole(ceil(pace * dt / FINEST)));
    const int end_2 = looks + 1;
    for (int k = 1; k < end_2; k++) {
        const double part_ = dt * k / looks;
        const tuple_ddd pose = integrate(&start, twist, lateral, part_);
        const Motion there = (Motion){pose, twist, lateral, time + part_, pace};
        const tuple_dd room_round_3 = room_round(setup, &there, view, most);
        const double distance = room_round_3._0;
        const double room = room_round_3._1;
        least = min2(least, distance);
        most = min2(most, room);
    }
    return (tuple_dd){least, most};
}

/* qpavoid.guide.way: Return how many numbers of memory a search needs. */
static int search_size(double half)
{
    const int fine = grid_size(half);
    const int cells = cells_of(half);
    const int size = fine * fine + cells * cells * (HEADINGS + 1);
    return size + MOST_NODES * (NODE + LINK) + most_waiting(half) * HEAP_WIDTH;
}

/* qpavoid.avoidance.state: Let (v, ω) be what has been driven up to now. */
static void set_driven(vector state, double v, double omega)
{
    state.at[V] = v;
    state.at[OMEGA] = omega;
    for (int i = 0; i < MOST_PENDING; i++) {
        state.at[PENDING + 2 * i] = v;
        state.at[PENDING + 2 * i + 1] = omega;
    }
}

/* qpavoid.tracking.clock: Return ρ = ds/dt: 1 up to a lag of ``free`` m, least_rate
 * from ``wide`` m on. */
static double progress_rate(double lag, double free, double wide, double least_rate)
{
    if (lag <= free) {
        return 1.0;
    }
    if (lag >= wide) {
        return least_rate;
    }
    double share = (wide - lag) / (wide - free);
    share = share * share * (3.0 - 2.0 * share);
    return min2(least_rate + (1.0 - least_rate) * share, 1.0);
}

/* qpavoid.tracking.clock: Return the reference for a robot, with ρ v_r and ρ ω_r for
 * its twist; and ρ. */
static tuple_Reference_d waiting_reference(matrix plan, double place, const tuple_ddd
    *restrict pose, const tuple_ddd *restrict lags)
{
    const Reference row_at_1 = row_at(plan, place);
    const double x_r = row_at_1.x;
    const double y_r = row_at_1.y;
    const double heading_r = row_at_1.heading;
    const double v_r = row_at_1.v;
    const double omega_r = row_at_1.omega;
    const double lag = (x_r - pose->_0) * cos(heading_r) + (y_r - pose->_1) *
        sin(heading_r);
    const double rate = progress_rate(lag, lags->_0, lags->_1, lags->_2);
    return (tuple_Reference_d){(Reference){x_r, y_r, heading_r, rate * v_r, rate *
        omega_r}, rate};
}

double qpavoid_activation(int kind, double distance, double r_min, double r)
{
    (void)kind;
    (void)distance;
    (void)r_min;
    (void)r;
    return activation(kind, distance, r_min, r);
}

void qpavoid_arc(double x, double y, double heading, double v, double omega, double dt,
    double *result)
{
    (void)x;
    (void)y;
    (void)heading;
    (void)v;
    (void)omega;
    (void)dt;
    const tuple_ddd answer = arc(x, y, heading, v, omega, dt);
    result[0] = answer._0;
    result[1] = answer._1;
    result[2] = answer._2;
}

int qpavoid_attempts(int prepared_code, double prepared_clearance, int prepared_most,
    int prepared_bodies, int prepared_m, int prepared_n_hard, double prepared_last_0,
    double prepared_last_1, double prepared_box_v_min, double prepared_box_v_max, double
    prepared_box_omega_min, double prepared_box_omega_max, double prepared_wish_0,
    double prepared_wish_1, double prepared_desired_0, double prepared_desired_1, double
    prepared_rest_0, double prepared_rest_1, double prepared_anchor_0, double
    prepared_anchor_1, double prepared_target_plan_v, double prepared_target_plan_omega,
    double prepared_target_plan_switch, double prepared_target_plan_v_then, double
    prepared_target_plan_omega_then, double prepared_target_plan_end, double
    prepared_target_mode, double prepared_target_room, int prepared_target_owner, bool
    prepared_ahead)
{
    (void)prepared_code;
    (void)prepared_clearance;
    (void)prepared_most;
    (void)prepared_bodies;
    (void)prepared_m;
    (void)prepared_n_hard;
    (void)prepared_last_0;
    (void)prepared_last_1;
    (void)prepared_box_v_min;
    (void)prepared_box_v_max;
    (void)prepared_box_omega_min;
    (void)prepared_box_omega_max;
    (void)prepared_wish_0;
    (void)prepared_wish_1;
    (void)prepared_desired_0;
    (void)prepared_desired_1;
    (void)prepared_rest_0;
    (void)prepared_rest_1;
    (void)prepared_anchor_0;
    (void)prepared_anchor_1;
    (void)prepared_target_plan_v;
    (void)prepared_target_plan_omega;
    (void)prepared_target_plan_switch;
    (void)prepared_target_plan_v_then;
    (void)prepared_target_plan_omega_then;
    (void)prepared_target_plan_end;
    (void)prepared_target_mode;
    (void)prepared_target_room;
    (void)prepared_target_owner;
    (void)prepared_ahead;
    return attempts((const Prepared[]){(Prepared){prepared_code, prepared_clearance,
        prepared_most, prepared_bodies, prepared_m, prepared_n_hard,
        (tuple_dd){prepared_last_0, prepared_last_1}, (Box){prepared_box_v_min,
        prepared_box_v_max, prepared_box_omega_min, prepared_box_omega_max},
        (tuple_dd){prepared_wish_0, prepared_wish_1}, (tuple_dd){prepared_desired_0,
        prepared_desired_1}, (tuple_dd){prepared_rest_0, prepared_rest_1},
        (tuple_dd){prepared_anchor_0, prepared_anchor_1},
        (Target){(Plan){prepared_target_plan_v, prepared_target_plan_omega,
        prepared_target_plan_switch, prepared_target_plan_v_then,
        prepared_target_plan_omega_then, prepared_target_plan_end},
        prepared_target_mode, prepared_target_room, prepared_target_owner},
        prepared_ahead}});
}

void qpavoid_best_lane(const double *search_edges, int search_edges_rows, int
    search_edges_columns, const double *search_obstacles_0, int search_obstacles_0_rows,
    int search_obstacles_0_columns, const double *search_obstacles_1, int
    search_obstacles_1_rows, int search_obstacles_1_columns, double *search_seen_0, int
    search_seen_0_rows, int search_seen_0_columns, double *search_seen_1, int
    search_seen_1_rows, int search_seen_1_columns, double *search_contacts, int
    search_contacts_rows, int search_contacts_columns, double search_radius, double
    search_keep, double search_v, double search_turn, double search_reverse, double
    search_ahead, double heading, double back, double *result)
{
    (void)search_edges;
    (void)search_edges_rows;
    (void)search_edges_columns;
    (void)search_obstacles_0;
    (void)search_obstacles_0_rows;
    (void)search_obstacles_0_columns;
    (void)search_obstacles_1;
    (void)search_obstacles_1_rows;
    (void)search_obstacles_1_columns;
    (void)search_seen_0;
    (void)search_seen_0_rows;
    (void)search_seen_0_columns;
    (void)search_seen_1;
    (void)search_seen_1_rows;
    (void)search_seen_1_columns;
    (void)search_contacts;
    (void)search_contacts_rows;
    (void)search_contacts_columns;
    (void)search_radius;
    (void)search_keep;
    (void)search_v;
    (void)search_turn;
    (void)search_reverse;
    (void)search_ahead;
    (void)heading;
    (void)back;
    const Lane answer = best_lane((const LaneSearch[]){(LaneSearch){(matrix){(double
        *)search_edges, search_edges_rows, search_edges_columns},
        (tuple_mm){(matrix){(double *)search_obstacles_0, search_obstacles_0_rows,
        search_obstacles_0_columns}, (matrix){(double *)search_obstacles_1,
        search_obstacles_1_rows, search_obstacles_1_columns}},
        (tuple_mm){(matrix){search_seen_0, search_seen_0_rows, search_seen_0_columns},
        (matrix){search_seen_1, search_seen_1_rows, search_seen_1_columns}},
        (matrix){search_contacts, search_contacts_rows, search_contacts_columns},
        search_radius, search_keep, search_v, search_turn, search_reverse,
        search_ahead}}, heading, back);
    result[0] = answer.aside;
    result[1] = answer.angle;
    result[2] = answer.far;
    result[3] = answer.back;
}

void qpavoid_braking_twist(const double *robot_, int robot_rows, double v, double omega,
    double dt, double *result)
{
    (void)robot_;
    (void)robot_rows;
    (void)v;
    (void)omega;
    (void)dt;
    const tuple_dd answer = braking_twist((vector){(double *)robot_, robot_rows}, v,
        omega, dt);
    result[0] = answer._0;
    result[1] = answer._1;
}

void qpavoid_certificate(const double *rows, int rows_rows, int rows_columns, double
    terms_box_v_min, double terms_box_v_max, double terms_box_omega_min, double
    terms_box_omega_max, double terms_desired_0, double terms_desired_1, double
    terms_weights_0, double terms_weights_1, int terms_n_hard, double relaxed, double
    twist_0, double twist_1, double *result)
{
    (void)rows;
    (void)rows_rows;
    (void)rows_columns;
    (void)terms_box_v_min;
    (void)terms_box_v_max;
    (void)terms_box_omega_min;
    (void)terms_box_omega_max;
    (void)terms_desired_0;
    (void)terms_desired_1;
    (void)terms_weights_0;
    (void)terms_weights_1;
    (void)terms_n_hard;
    (void)relaxed;
    (void)twist_0;
    (void)twist_1;
    const tuple_dd answer = certificate((matrix){(double *)rows, rows_rows,
        rows_columns}, (const Terms[]){(Terms){(Box){terms_box_v_min, terms_box_v_max,
        terms_box_omega_min, terms_box_omega_max}, (tuple_dd){terms_desired_0,
        terms_desired_1}, (tuple_dd){terms_weights_0, terms_weights_1}, terms_n_hard}},
        relaxed, (tuple_dd){twist_0, twist_1});
    result[0] = answer._0;
    result[1] = answer._1;
}

void qpavoid_contact_at(const double *contacts, int contacts_rows, int contacts_columns,
    int row, double *result)
{
    (void)contacts;
    (void)contacts_rows;
    (void)contacts_columns;
    (void)row;
    const ObstacleContact answer = contact_at((matrix){(double *)contacts,
        contacts_rows, contacts_columns}, row);
    result[0] = answer.x;
    result[1] = answer.y;
    result[2] = answer.n_x;
    result[3] = answer.n_y;
    result[4] = answer.distance;
    result[5] = answer.v_x;
    result[6] = answer.v_y;
    result[7] = answer.obstacle;
    result[8] = answer.segment;
}

void qpavoid_contact_table(const double *edges_, int edges_rows, int edges_columns,
    double circumradius, const double *obstacles_0, int obstacles_0_rows, int
    obstacles_0_columns, const double *obstacles_1, int obstacles_1_rows, int
    obstacles_1_columns, double reach, double *contacts, int contacts_rows, int
    contacts_columns, double *result)
{
    (void)edges_;
    (void)edges_rows;
    (void)edges_columns;
    (void)circumradius;
    (void)obstacles_0;
    (void)obstacles_0_rows;
    (void)obstacles_0_columns;
    (void)obstacles_1;
    (void)obstacles_1_rows;
    (void)obstacles_1_columns;
    (void)reach;
    (void)contacts;
    (void)contacts_rows;
    (void)contacts_columns;
    const tuple_ii answer = contact_table((matrix){(double *)edges_, edges_rows,
        edges_columns}, circumradius, (const tuple_mm[]){(tuple_mm){(matrix){(double
        *)obstacles_0, obstacles_0_rows, obstacles_0_columns}, (matrix){(double
        *)obstacles_1, obstacles_1_rows, obstacles_1_columns}}}, reach,
        (matrix){contacts, contacts_rows, contacts_columns});
    result[0] = answer._0;
    result[1] = answer._1;
}

void qpavoid_decide(const double *setup_edges, int setup_edges_rows, int
    setup_edges_columns, const double *setup_robot, int setup_robot_rows, const void
    *setup_settings, int prepared_code, double prepared_clearance, int prepared_most,
    int prepared_bodies, int prepared_m, int prepared_n_hard, double prepared_last_0,
    double prepared_last_1, double prepared_box_v_min, double prepared_box_v_max, double
    prepared_box_omega_min, double prepared_box_omega_max, double prepared_wish_0,
    double prepared_wish_1, double prepared_desired_0, double prepared_desired_1, double
    prepared_rest_0, double prepared_rest_1, double prepared_anchor_0, double
    prepared_anchor_1, double prepared_target_plan_v, double prepared_target_plan_omega,
    double prepared_target_plan_switch, double prepared_target_plan_v_then, double
    prepared_target_plan_omega_then, double prepared_target_plan_end, double
    prepared_target_mode, double prepared_target_room, int prepared_target_owner, bool
    prepared_ahead, double *memory, int memory_rows, int attempt, double rejected_0,
    double rejected_1, double answer_0, double answer_1, double *state, int state_rows,
    double *result)
{
    (void)setup_edges;
    (void)setup_edges_rows;
    (void)setup_edges_columns;
    (void)setup_robot;
    (void)setup_robot_rows;
    (void)setup_settings;
    (void)prepared_code;
    (void)prepared_clearance;
    (void)prepared_most;
    (void)prepared_bodies;
    (void)prepared_m;
    (void)prepared_n_hard;
    (void)prepared_last_0;
    (void)prepared_last_1;
    (void)prepared_box_v_min;
    (void)prepared_box_v_max;
    (void)prepared_box_omega_min;
    (void)prepared_box_omega_max;
    (void)prepared_wish_0;
    (void)prepared_wish_1;
    (void)prepared_desired_0;
    (void)prepared_desired_1;
    (void)prepared_rest_0;
    (void)prepared_rest_1;
    (void)prepared_anchor_0;
    (void)prepared_anchor_1;
    (void)prepared_target_plan_v;
    (void)prepared_target_plan_omega;
    (void)prepared_target_plan_switch;
    (void)prepared_target_plan_v_then;
    (void)prepared_target_plan_omega_then;
    (void)prepared_target_plan_end;
    (void)prepared_target_mode;
    (void)prepared_target_room;
    (void)prepared_target_owner;
    (void)prepared_ahead;
    (void)memory;
    (void)memory_rows;
    (void)attempt;
    (void)rejected_0;
    (void)rejected_1;
    (void)answer_0;
    (void)answer_1;
    (void)state;
    (void)state_rows;
    const Outcome answer = decide((const Setup[]){(Setup){(matrix){(double
        *)setup_edges, setup_edges_rows, setup_edges_columns}, (vector){(double
        *)setup_robot, setup_robot_rows}, (filter_settings)setup_settings}}, (const
        Prepared[]){(Prepared){prepared_code, prepared_clearance, prepared_most,
        prepared_bodies, prepared_m, prepared_n_hard, (tuple_dd){prepared_last_0,
        prepared_last_1}, (Box){prepared_box_v_min, prepared_box_v_max,
        prepared_box_omega_min, prepared_box_omega_max}, (tuple_dd){prepared_wish_0,
        prepared_wish_1}, (tuple_dd){prepared_desired_0, prepared_desired_1},
        (tuple_dd){prepared_rest_0, prepared_rest_1}, (tuple_dd){prepared_anchor_0,
        prepared_anchor_1}, (Target){(Plan){prepared_target_plan_v,
        prepared_target_plan_omega, prepared_target_plan_switch,
        prepared_target_plan_v_then, prepared_target_plan_omega_then,
        prepared_target_plan_end}, prepared_target_mode, prepared_target_room,
        prepared_target_owner}, prepared_ahead}}, (vector){memory, memory_rows},
        attempt, (tuple_dd){rejected_0, rejected_1}, (tuple_dd){answer_0, answer_1},
        (vector){state, state_rows});
    result[0] = answer.code;
    result[1] = answer.v;
    result[2] = answer.omega;
    result[3] = answer.clearance;
    result[4] = answer.slack;
    result[5] = answer.residual;
    result[6] = answer.shortfall;
    result[7] = answer.first;
    result[8] = answer.second;
}

void qpavoid_detour_step(const double *stage_setup_edges, int stage_setup_edges_rows,
    int stage_setup_edges_columns, const double *stage_setup_robot, int
    stage_setup_robot_rows, const void *stage_setup_settings, const double *stage_law,
    int stage_law_rows, const void *stage_settings, const double *stage_body, int
    stage_body_rows, int stage_body_columns, double *state, int state_rows, double
    *memory_bodies, int memory_bodies_rows, int memory_bodies_columns, double
    *memory_search, int memory_search_rows, const double *obstacles_0, int
    obstacles_0_rows, int obstacles_0_columns, const double *obstacles_1, int
    obstacles_1_rows, int obstacles_1_columns, double tracking_desired_0, double
    tracking_desired_1, double tracking_error_0, double tracking_error_1, double
    tracking_error_2, double tracking_v_r, double tracking_driven_0, double
    tracking_driven_1, double tracking_dt, const double *tracking_ahead, int
    tracking_ahead_rows, int tracking_ahead_columns, double *result)
{
    (void)stage_setup_edges;
    (void)stage_setup_edges_rows;
    (void)stage_setup_edges_columns;
    (void)stage_setup_robot;
    (void)stage_setup_robot_rows;
    (void)stage_setup_settings;
    (void)stage_law;
    (void)stage_law_rows;
    (void)stage_settings;
    (void)stage_body;
    (void)stage_body_rows;
    (void)stage_body_columns;
    (void)state;
    (void)state_rows;
    (void)memory_bodies;
    (void)memory_bodies_rows;
    (void)memory_bodies_columns;
    (void)memory_search;
    (void)memory_search_rows;
    (void)obstacles_0;
    (void)obstacles_0_rows;
    (void)obstacles_0_columns;
    (void)obstacles_1;
    (void)obstacles_1_rows;
    (void)obstacles_1_columns;
    (void)tracking_desired_0;
    (void)tracking_desired_1;
    (void)tracking_error_0;
    (void)tracking_error_1;
    (void)tracking_error_2;
    (void)tracking_v_r;
    (void)tracking_driven_0;
    (void)tracking_driven_1;
    (void)tracking_dt;
    (void)tracking_ahead;
    (void)tracking_ahead_rows;
    (void)tracking_ahead_columns;
    const tuple_idd answer = detour_step((const
        Stage[]){(Stage){(Setup){(matrix){(double *)stage_setup_edges,
        stage_setup_edges_rows, stage_setup_edges_columns}, (vector){(double
        *)stage_setup_robot, stage_setup_robot_rows},
        (filter_settings)stage_setup_settings}, (vector){(double *)stage_law,
        stage_law_rows}, (guide_settings)stage_settings, (matrix){(double *)stage_body,
        stage_body_rows, stage_body_columns}}}, (vector){state, state_rows}, (const
        StageMemory[]){(StageMemory){(matrix){memory_bodies, memory_bodies_rows,
        memory_bodies_columns}, (vector){memory_search, memory_search_rows}}}, (const
        tuple_mm[]){(tuple_mm){(matrix){(double *)obstacles_0, obstacles_0_rows,
        obstacles_0_columns}, (matrix){(double *)obstacles_1, obstacles_1_rows,
        obstacles_1_columns}}}, (const
        Tracking[]){(Tracking){(tuple_dd){tracking_desired_0, tracking_desired_1},
        (tuple_ddd){tracking_error_0, tracking_error_1, tracking_error_2}, tracking_v_r,
        (tuple_dd){tracking_driven_0, tracking_driven_1}, tracking_dt, (matrix){(double
        *)tracking_ahead, tracking_ahead_rows, tracking_ahead_columns}}});
    result[0] = answer._0;
    result[1] = answer._1;
    result[2] = answer._2;
}

bool qpavoid_differs(double free_0, double free_1, double twist_0, double twist_1)
{
    (void)free_0;
    (void)free_1;
    (void)twist_0;
    (void)twist_1;
    return differs((tuple_dd){free_0, free_1}, (tuple_dd){twist_0, twist_1});
}

void qpavoid_driven_twist(const double *robot_, int robot_rows, double v, double omega,
    double *result)
{
    (void)robot_;
    (void)robot_rows;
    (void)v;
    (void)omega;
    const tuple_dd answer = driven_twist((vector){(double *)robot_, robot_rows}, v,
        omega);
    result[0] = answer._0;
    result[1] = answer._1;
}

void qpavoid_eq5(double p_x, double p_y, double n_x, double n_y, double speed, double
    damping, double *result)
{
    (void)p_x;
    (void)p_y;
    (void)n_x;
    (void)n_y;
    (void)speed;
    (void)damping;
    const tuple_dd answer = eq5(p_x, p_y, n_x, n_y, speed, damping);
    result[0] = answer._0;
    result[1] = answer._1;
}

void qpavoid_eq7(double p_x, double p_y, double n_x, double n_y, double speed, double
    damping, double *result)
{
    (void)p_x;
    (void)p_y;
    (void)n_x;
    (void)n_y;
    (void)speed;
    (void)damping;
    const tuple_dd answer = eq7(p_x, p_y, n_x, n_y, speed, damping);
    result[0] = answer._0;
    result[1] = answer._1;
}

void qpavoid_fill_ahead(const double *plan, int plan_rows, int plan_columns, double
    place, double pose_0, double pose_1, double pose_2, double stride, double *ahead,
    int ahead_rows, int ahead_columns)
{
    (void)plan;
    (void)plan_rows;
    (void)plan_columns;
    (void)place;
    (void)pose_0;
    (void)pose_1;
    (void)pose_2;
    (void)stride;
    (void)ahead;
    (void)ahead_rows;
    (void)ahead_columns;
    fill_ahead((matrix){(double *)plan, plan_rows, plan_columns}, place, (const
        tuple_ddd[]){(tuple_ddd){pose_0, pose_1, pose_2}}, stride, (matrix){ahead,
        ahead_rows, ahead_columns});
}

int qpavoid_fill_capsules(int first, const double *discs, int discs_rows, int
    discs_columns, const double *disc_velocities, int disc_velocities_rows, int
    disc_velocities_columns, const double *walls, int walls_rows, int walls_columns,
    const double *wall_velocities, int wall_velocities_rows, int
    wall_velocities_columns, const double *corners, int corners_rows, int
    corners_columns, const double *polygons, int polygons_rows, int polygons_columns,
    double *capsules, int capsules_rows, int capsules_columns)
{
    (void)first;
    (void)discs;
    (void)discs_rows;
    (void)discs_columns;
    (void)disc_velocities;
    (void)disc_velocities_rows;
    (void)disc_velocities_columns;
    (void)walls;
    (void)walls_rows;
    (void)walls_columns;
    (void)wall_velocities;
    (void)wall_velocities_rows;
    (void)wall_velocities_columns;
    (void)corners;
    (void)corners_rows;
    (void)corners_columns;
    (void)polygons;
    (void)polygons_rows;
    (void)polygons_columns;
    (void)capsules;
    (void)capsules_rows;
    (void)capsules_columns;
    return fill_capsules(first, (matrix){(double *)discs, discs_rows, discs_columns},
        (matrix){(double *)disc_velocities, disc_velocities_rows,
        disc_velocities_columns}, (matrix){(double *)walls, walls_rows, walls_columns},
        (matrix){(double *)wall_velocities, wall_velocities_rows,
        wall_velocities_columns}, (matrix){(double *)corners, corners_rows,
        corners_columns}, (matrix){(double *)polygons, polygons_rows, polygons_columns},
        (matrix){capsules, capsules_rows, capsules_columns});
}

double qpavoid_fill_places(const double *setup_edges, int setup_edges_rows, int
    setup_edges_columns, const double *setup_robot, int setup_robot_rows, const void
    *setup_settings, double plan_v, double plan_omega, double plan_switch, double
    plan_v_then, double plan_omega_then, double plan_end, double twist_0, double
    twist_1, const double *times, int times_rows, double *arcs, int arcs_rows, int
    arcs_columns, double *places, int places_rows, int places_columns)
{
    (void)setup_edges;
    (void)setup_edges_rows;
    (void)setup_edges_columns;
    (void)setup_robot;
    (void)setup_robot_rows;
    (void)setup_settings;
    (void)plan_v;
    (void)plan_omega;
    (void)plan_switch;
    (void)plan_v_then;
    (void)plan_omega_then;
    (void)plan_end;
    (void)twist_0;
    (void)twist_1;
    (void)times;
    (void)times_rows;
    (void)arcs;
    (void)arcs_rows;
    (void)arcs_columns;
    (void)places;
    (void)places_rows;
    (void)places_columns;
    return fill_places((const Setup[]){(Setup){(matrix){(double *)setup_edges,
        setup_edges_rows, setup_edges_columns}, (vector){(double *)setup_robot,
        setup_robot_rows}, (filter_settings)setup_settings}}, (const
        Plan[]){(Plan){plan_v, plan_omega, plan_switch, plan_v_then, plan_omega_then,
        plan_end}}, (tuple_dd){twist_0, twist_1}, (vector){(double *)times, times_rows},
        (matrix){arcs, arcs_rows, arcs_columns}, (matrix){places, places_rows,
        places_columns});
}

void qpavoid_filter_step(const double *edges_, int edges_rows, int edges_columns, const
    double *robot_, int robot_rows, const void *settings_, const double *points, int
    points_rows, int points_columns, const double *capsules, int capsules_rows, int
    capsules_columns, double age, bool ahead, double v, double omega, double *state, int
    state_rows, double *memory, int memory_rows, double *result)
{
    (void)edges_;
    (void)edges_rows;
    (void)edges_columns;
    (void)robot_;
    (void)robot_rows;
    (void)settings_;
    (void)points;
    (void)points_rows;
    (void)points_columns;
    (void)capsules;
    (void)capsules_rows;
    (void)capsules_columns;
    (void)age;
    (void)ahead;
    (void)v;
    (void)omega;
    (void)state;
    (void)state_rows;
    (void)memory;
    (void)memory_rows;
    const tuple_iddddddii answer = filter_step((matrix){(double *)edges_, edges_rows,
        edges_columns}, (vector){(double *)robot_, robot_rows},
        (filter_settings)settings_, (matrix){(double *)points, points_rows,
        points_columns}, (matrix){(double *)capsules, capsules_rows, capsules_columns},
        age, ahead, v, omega, (vector){state, state_rows}, (vector){memory,
        memory_rows});
    result[0] = answer._0;
    result[1] = answer._1;
    result[2] = answer._2;
    result[3] = answer._3;
    result[4] = answer._4;
    result[5] = answer._5;
    result[6] = answer._6;
    result[7] = answer._7;
    result[8] = answer._8;
}

double qpavoid_free_share(const double *search_edges, int search_edges_rows, int
    search_edges_columns, const double *search_obstacles_0, int search_obstacles_0_rows,
    int search_obstacles_0_columns, const double *search_obstacles_1, int
    search_obstacles_1_rows, int search_obstacles_1_columns, double *search_seen_0, int
    search_seen_0_rows, int search_seen_0_columns, double *search_seen_1, int
    search_seen_1_rows, int search_seen_1_columns, double *search_contacts, int
    search_contacts_rows, int search_contacts_columns, double search_radius, double
    search_keep, double search_v, double search_turn, double search_reverse, double
    search_ahead, double pose_0, double pose_1, double pose_2, double twist_0, double
    twist_1, double time)
{
    (void)search_edges;
    (void)search_edges_rows;
    (void)search_edges_columns;
    (void)search_obstacles_0;
    (void)search_obstacles_0_rows;
    (void)search_obstacles_0_columns;
    (void)search_obstacles_1;
    (void)search_obstacles_1_rows;
    (void)search_obstacles_1_columns;
    (void)search_seen_0;
    (void)search_seen_0_rows;
    (void)search_seen_0_columns;
    (void)search_seen_1;
    (void)search_seen_1_rows;
    (void)search_seen_1_columns;
    (void)search_contacts;
    (void)search_contacts_rows;
    (void)search_contacts_columns;
    (void)search_radius;
    (void)search_keep;
    (void)search_v;
    (void)search_turn;
    (void)search_reverse;
    (void)search_ahead;
    (void)pose_0;
    (void)pose_1;
    (void)pose_2;
    (void)twist_0;
    (void)twist_1;
    (void)time;
    return free_share((const LaneSearch[]){(LaneSearch){(matrix){(double *)search_edges,
        search_edges_rows, search_edges_columns}, (tuple_mm){(matrix){(double
        *)search_obstacles_0, search_obstacles_0_rows, search_obstacles_0_columns},
        (matrix){(double *)search_obstacles_1, search_obstacles_1_rows,
        search_obstacles_1_columns}}, (tuple_mm){(matrix){search_seen_0,
        search_seen_0_rows, search_seen_0_columns}, (matrix){search_seen_1,
        search_seen_1_rows, search_seen_1_columns}}, (matrix){search_contacts,
        search_contacts_rows, search_contacts_columns}, search_radius, search_keep,
        search_v, search_turn, search_reverse, search_ahead}}, (const
        tuple_ddd[]){(tuple_ddd){pose_0, pose_1, pose_2}}, (tuple_dd){twist_0, twist_1},
        time);
}

double qpavoid_greatest_pace(const double *robot_, int robot_rows, double v, double
    omega, double fastest)
{
    (void)robot_;
    (void)robot_rows;
    (void)v;
    (void)omega;
    (void)fastest;
    return greatest_pace((vector){(double *)robot_, robot_rows}, v, omega, fastest);
}

double qpavoid_greatest_speed(const double *capsules, int capsules_rows, int
    capsules_columns)
{
    (void)capsules;
    (void)capsules_rows;
    (void)capsules_columns;
    return greatest_speed((matrix){(double *)capsules, capsules_rows,
        capsules_columns});
}

double qpavoid_half_planes(double *rows, int rows_rows, int rows_columns, double
    terms_box_v_min, double terms_box_v_max, double terms_box_omega_min, double
    terms_box_omega_max, double terms_desired_0, double terms_desired_1, double
    terms_weights_0, double terms_weights_1, int terms_n_hard)
{
    (void)rows;
    (void)rows_rows;
    (void)rows_columns;
    (void)terms_box_v_min;
    (void)terms_box_v_max;
    (void)terms_box_omega_min;
    (void)terms_box_omega_max;
    (void)terms_desired_0;
    (void)terms_desired_1;
    (void)terms_weights_0;
    (void)terms_weights_1;
    (void)terms_n_hard;
    return half_planes((matrix){rows, rows_rows, rows_columns}, (const
        Terms[]){(Terms){(Box){terms_box_v_min, terms_box_v_max, terms_box_omega_min,
        terms_box_omega_max}, (tuple_dd){terms_desired_0, terms_desired_1},
        (tuple_dd){terms_weights_0, terms_weights_1}, terms_n_hard}});
}

bool qpavoid_has_length(const double *capsules, int capsules_rows, int capsules_columns,
    int i)
{
    (void)capsules;
    (void)capsules_rows;
    (void)capsules_columns;
    (void)i;
    return has_length((matrix){(double *)capsules, capsules_rows, capsules_columns}, i);
}

void qpavoid_in_robot_frame(double pose_0, double pose_1, double pose_2, double time,
    const double *world_0, int world_0_rows, int world_0_columns, const double *world_1,
    int world_1_rows, int world_1_columns, double *seen_0, int seen_0_rows, int
    seen_0_columns, double *seen_1, int seen_1_rows, int seen_1_columns)
{
    (void)pose_0;
    (void)pose_1;
    (void)pose_2;
    (void)time;
    (void)world_0;
    (void)world_0_rows;
    (void)world_0_columns;
    (void)world_1;
    (void)world_1_rows;
    (void)world_1_columns;
    (void)seen_0;
    (void)seen_0_rows;
    (void)seen_0_columns;
    (void)seen_1;
    (void)seen_1_rows;
    (void)seen_1_columns;
    in_robot_frame((const tuple_ddd[]){(tuple_ddd){pose_0, pose_1, pose_2}}, time,
        (const tuple_mm[]){(tuple_mm){(matrix){(double *)world_0, world_0_rows,
        world_0_columns}, (matrix){(double *)world_1, world_1_rows, world_1_columns}}},
        (const tuple_mm[]){(tuple_mm){(matrix){seen_0, seen_0_rows, seen_0_columns},
        (matrix){seen_1, seen_1_rows, seen_1_columns}}});
}

void qpavoid_integrate(double pose_0, double pose_1, double pose_2, double twist_0,
    double twist_1, double lateral, double dt, double *result)
{
    (void)pose_0;
    (void)pose_1;
    (void)pose_2;
    (void)twist_0;
    (void)twist_1;
    (void)lateral;
    (void)dt;
    const tuple_ddd answer = integrate((const tuple_ddd[]){(tuple_ddd){pose_0, pose_1,
        pose_2}}, (tuple_dd){twist_0, twist_1}, lateral, dt);
    result[0] = answer._0;
    result[1] = answer._1;
    result[2] = answer._2;
}

bool qpavoid_is_over(double time, double quiet, void *outcome, double settled)
{
    (void)time;
    (void)quiet;
    (void)outcome;
    (void)settled;
    return is_over(time, quiet, (loop_outcome)outcome, settled);
}

void qpavoid_kanayama(double error_0, double error_1, double error_2, double
    reference_0, double reference_1, double gains_0, double gains_1, double gains_2,
    double *result)
{
    (void)error_0;
    (void)error_1;
    (void)error_2;
    (void)reference_0;
    (void)reference_1;
    (void)gains_0;
    (void)gains_1;
    (void)gains_2;
    const tuple_dd answer = kanayama((const tuple_ddd[]){(tuple_ddd){error_0, error_1,
        error_2}}, (tuple_dd){reference_0, reference_1}, (const
        tuple_ddd[]){(tuple_ddd){gains_0, gains_1, gains_2}});
    result[0] = answer._0;
    result[1] = answer._1;
}

void qpavoid_kept_plan(const double *state, int state_rows, double *result)
{
    (void)state;
    (void)state_rows;
    const Plan answer = kept_plan((vector){(double *)state, state_rows});
    result[0] = answer.v;
    result[1] = answer.omega;
    result[2] = answer.switch_;
    result[3] = answer.v_then;
    result[4] = answer.omega_then;
    result[5] = answer.end;
}

bool qpavoid_leads_on(const double *search_edges, int search_edges_rows, int
    search_edges_columns, const double *search_obstacles_0, int search_obstacles_0_rows,
    int search_obstacles_0_columns, const double *search_obstacles_1, int
    search_obstacles_1_rows, int search_obstacles_1_columns, double *search_seen_0, int
    search_seen_0_rows, int search_seen_0_columns, double *search_seen_1, int
    search_seen_1_rows, int search_seen_1_columns, double *search_contacts, int
    search_contacts_rows, int search_contacts_columns, double search_radius, double
    search_keep, double search_v, double search_turn, double search_reverse, double
    search_ahead, double pose_0, double pose_1, double pose_2, double heading)
{
    (void)search_edges;
    (void)search_edges_rows;
    (void)search_edges_columns;
    (void)search_obstacles_0;
    (void)search_obstacles_0_rows;
    (void)search_obstacles_0_columns;
    (void)search_obstacles_1;
    (void)search_obstacles_1_rows;
    (void)search_obstacles_1_columns;
    (void)search_seen_0;
    (void)search_seen_0_rows;
    (void)search_seen_0_columns;
    (void)search_seen_1;
    (void)search_seen_1_rows;
    (void)search_seen_1_columns;
    (void)search_contacts;
    (void)search_contacts_rows;
    (void)search_contacts_columns;
    (void)search_radius;
    (void)search_keep;
    (void)search_v;
    (void)search_turn;
    (void)search_reverse;
    (void)search_ahead;
    (void)pose_0;
    (void)pose_1;
    (void)pose_2;
    (void)heading;
    return leads_on((const LaneSearch[]){(LaneSearch){(matrix){(double *)search_edges,
        search_edges_rows, search_edges_columns}, (tuple_mm){(matrix){(double
        *)search_obstacles_0, search_obstacles_0_rows, search_obstacles_0_columns},
        (matrix){(double *)search_obstacles_1, search_obstacles_1_rows,
        search_obstacles_1_columns}}, (tuple_mm){(matrix){search_seen_0,
        search_seen_0_rows, search_seen_0_columns}, (matrix){search_seen_1,
        search_seen_1_rows, search_seen_1_columns}}, (matrix){search_contacts,
        search_contacts_rows, search_contacts_columns}, search_radius, search_keep,
        search_v, search_turn, search_reverse, search_ahead}}, (const
        tuple_ddd[]){(tuple_ddd){pose_0, pose_1, pose_2}}, heading);
}

void qpavoid_limit_twist(const double *robot_, int robot_rows, double twist_0, double
    twist_1, double last_0, double last_1, double dt, double *result)
{
    (void)robot_;
    (void)robot_rows;
    (void)twist_0;
    (void)twist_1;
    (void)last_0;
    (void)last_1;
    (void)dt;
    const tuple_dd answer = limit_twist((vector){(double *)robot_, robot_rows},
        (tuple_dd){twist_0, twist_1}, (tuple_dd){last_0, last_1}, dt);
    result[0] = answer._0;
    result[1] = answer._1;
}

void qpavoid_limits_of(const double *robot_, int robot_rows, double *result)
{
    (void)robot_;
    (void)robot_rows;
    const RobotLimits answer = limits_of((vector){(double *)robot_, robot_rows});
    result[0] = answer.v_min;
    result[1] = answer.v_max;
    result[2] = answer.omega_min;
    result[3] = answer.omega_max;
    result[4] = answer.acceleration;
    result[5] = answer.angular_acceleration;
    result[6] = answer.wheel_speed;
    result[7] = answer.track;
    result[8] = answer.circumradius;
}

int qpavoid_look_ticks(const void *settings_)
{
    (void)settings_;
    return look_ticks((filter_settings)settings_);
}

int qpavoid_memory_size(int contacts, const void *settings_)
{
    (void)contacts;
    (void)settings_;
    return memory_size(contacts, (filter_settings)settings_);
}

int qpavoid_most_arcs(const void *settings_)
{
    (void)settings_;
    return most_arcs((filter_settings)settings_);
}

int qpavoid_most_contacts(const double *edges_, int edges_rows, int edges_columns, const
    double *obstacles_0, int obstacles_0_rows, int obstacles_0_columns, const double
    *obstacles_1, int obstacles_1_rows, int obstacles_1_columns)
{
    (void)edges_;
    (void)edges_rows;
    (void)edges_columns;
    (void)obstacles_0;
    (void)obstacles_0_rows;
    (void)obstacles_0_columns;
    (void)obstacles_1;
    (void)obstacles_1_rows;
    (void)obstacles_1_columns;
    return most_contacts((matrix){(double *)edges_, edges_rows, edges_columns}, (const
        tuple_mm[]){(tuple_mm){(matrix){(double *)obstacles_0, obstacles_0_rows,
        obstacles_0_columns}, (matrix){(double *)obstacles_1, obstacles_1_rows,
        obstacles_1_columns}}});
}

int qpavoid_most_sides(int ticks)
{
    (void)ticks;
    return most_sides(ticks);
}

void qpavoid_moved_on(double frame_x, double frame_y, double frame_cos, double
    frame_sin, double v, double omega, double time, double *result)
{
    (void)frame_x;
    (void)frame_y;
    (void)frame_cos;
    (void)frame_sin;
    (void)v;
    (void)omega;
    (void)time;
    const Frame answer = moved_on((const Frame[]){(Frame){frame_x, frame_y, frame_cos,
        frame_sin}}, v, omega, time);
    result[0] = answer.x;
    result[1] = answer.y;
    result[2] = answer.cos;
    result[3] = answer.sin;
}

void qpavoid_nearest(const double *search_edges, int search_edges_rows, int
    search_edges_columns, const double *search_obstacles_0, int search_obstacles_0_rows,
    int search_obstacles_0_columns, const double *search_obstacles_1, int
    search_obstacles_1_rows, int search_obstacles_1_columns, double *search_seen_0, int
    search_seen_0_rows, int search_seen_0_columns, double *search_seen_1, int
    search_seen_1_rows, int search_seen_1_columns, double *search_contacts, int
    search_contacts_rows, int search_contacts_columns, double search_radius, double
    search_keep, double search_v, double search_turn, double search_reverse, double
    search_ahead, double pose_0, double pose_1, double pose_2, double *result)
{
    (void)search_edges;
    (void)search_edges_rows;
    (void)search_edges_columns;
    (void)search_obstacles_0;
    (void)search_obstacles_0_rows;
    (void)search_obstacles_0_columns;
    (void)search_obstacles_1;
    (void)search_obstacles_1_rows;
    (void)search_obstacles_1_columns;
    (void)search_seen_0;
    (void)search_seen_0_rows;
    (void)search_seen_0_columns;
    (void)search_seen_1;
    (void)search_seen_1_rows;
    (void)search_seen_1_columns;
    (void)search_contacts;
    (void)search_contacts_rows;
    (void)search_contacts_columns;
    (void)search_radius;
    (void)search_keep;
    (void)search_v;
    (void)search_turn;
    (void)search_reverse;
    (void)search_ahead;
    (void)pose_0;
    (void)pose_1;
    (void)pose_2;
    const tuple_dd answer = nearest((const LaneSearch[]){(LaneSearch){(matrix){(double
        *)search_edges, search_edges_rows, search_edges_columns},
        (tuple_mm){(matrix){(double *)search_obstacles_0, search_obstacles_0_rows,
        search_obstacles_0_columns}, (matrix){(double *)search_obstacles_1,
        search_obstacles_1_rows, search_obstacles_1_columns}},
        (tuple_mm){(matrix){search_seen_0, search_seen_0_rows, search_seen_0_columns},
        (matrix){search_seen_1, search_seen_1_rows, search_seen_1_columns}},
        (matrix){search_contacts, search_contacts_rows, search_contacts_columns},
        search_radius, search_keep, search_v, search_turn, search_reverse,
        search_ahead}}, (const tuple_ddd[]){(tuple_ddd){pose_0, pose_1, pose_2}});
    result[0] = answer._0;
    result[1] = answer._1;
}

double qpavoid_nearest_distance(const double *contacts, int contacts_rows, int
    contacts_columns, int nearest)
{
    (void)contacts;
    (void)contacts_rows;
    (void)contacts_columns;
    (void)nearest;
    return nearest_distance((matrix){(double *)contacts, contacts_rows,
        contacts_columns}, nearest);
}

void qpavoid_nearest_point(const double *rows, int rows_rows, int rows_columns, double
    z_1, double z_2, double slack, double *result)
{
    (void)rows;
    (void)rows_rows;
    (void)rows_columns;
    (void)z_1;
    (void)z_2;
    (void)slack;
    const Projection answer = nearest_point((matrix){(double *)rows, rows_rows,
        rows_columns}, z_1, z_2, slack);
    result[0] = answer.found;
    result[1] = answer.z_1;
    result[2] = answer.z_2;
    result[3] = answer.first;
    result[4] = answer.second;
    result[5] = answer.wanted;
}

void qpavoid_note_arrival(void *outcome, double goal_pose_0, double goal_pose_1, double
    goal_pose_2, double goal_near, double goal_aligned, double pose_0, double pose_1,
    double pose_2, double time)
{
    (void)outcome;
    (void)goal_pose_0;
    (void)goal_pose_1;
    (void)goal_pose_2;
    (void)goal_near;
    (void)goal_aligned;
    (void)pose_0;
    (void)pose_1;
    (void)pose_2;
    (void)time;
    note_arrival((loop_outcome)outcome, (const Goal2[]){(Goal2){(tuple_ddd){goal_pose_0,
        goal_pose_1, goal_pose_2}, goal_near, goal_aligned}}, (const
        tuple_ddd[]){(tuple_ddd){pose_0, pose_1, pose_2}}, time);
}

void qpavoid_point_contact(const double *edges_, int edges_rows, int edges_columns,
    double x, double y, double *result)
{
    (void)edges_;
    (void)edges_rows;
    (void)edges_columns;
    (void)x;
    (void)y;
    const Contact answer = point_contact((matrix){(double *)edges_, edges_rows,
        edges_columns}, x, y);
    result[0] = answer.x;
    result[1] = answer.y;
    result[2] = answer.n_x;
    result[3] = answer.n_y;
    result[4] = answer.distance;
    result[5] = answer.segment;
}

void qpavoid_prepare(const double *setup_edges, int setup_edges_rows, int
    setup_edges_columns, const double *setup_robot, int setup_robot_rows, const void
    *setup_settings, const double *request_obstacles_0, int request_obstacles_0_rows,
    int request_obstacles_0_columns, const double *request_obstacles_1, int
    request_obstacles_1_rows, int request_obstacles_1_columns, double request_age, bool
    request_ahead, double request_desired_0, double request_desired_1, double *state,
    int state_rows, double *memory, int memory_rows, double *result)
{
    (void)setup_edges;
    (void)setup_edges_rows;
    (void)setup_edges_columns;
    (void)setup_robot;
    (void)setup_robot_rows;
    (void)setup_settings;
    (void)request_obstacles_0;
    (void)request_obstacles_0_rows;
    (void)request_obstacles_0_columns;
    (void)request_obstacles_1;
    (void)request_obstacles_1_rows;
    (void)request_obstacles_1_columns;
    (void)request_age;
    (void)request_ahead;
    (void)request_desired_0;
    (void)request_desired_1;
    (void)state;
    (void)state_rows;
    (void)memory;
    (void)memory_rows;
    const Prepared answer = prepare((const Setup[]){(Setup){(matrix){(double
        *)setup_edges, setup_edges_rows, setup_edges_columns}, (vector){(double
        *)setup_robot, setup_robot_rows}, (filter_settings)setup_settings}}, (const
        Request[]){(Request){(tuple_mm){(matrix){(double *)request_obstacles_0,
        request_obstacles_0_rows, request_obstacles_0_columns}, (matrix){(double
        *)request_obstacles_1, request_obstacles_1_rows, request_obstacles_1_columns}},
        request_age, request_ahead, (tuple_dd){request_desired_0, request_desired_1}}},
        (vector){state, state_rows}, (vector){memory, memory_rows});
    result[0] = answer.code;
    result[1] = answer.clearance;
    result[2] = answer.most;
    result[3] = answer.bodies;
    result[4] = answer.m;
    result[5] = answer.n_hard;
    result[6] = answer.last._0;
    result[7] = answer.last._1;
    result[8] = answer.box.v_min;
    result[9] = answer.box.v_max;
    result[10] = answer.box.omega_min;
    result[11] = answer.box.omega_max;
    result[12] = answer.wish._0;
    result[13] = answer.wish._1;
    result[14] = answer.desired._0;
    result[15] = answer.desired._1;
    result[16] = answer.rest._0;
    result[17] = answer.rest._1;
    result[18] = answer.anchor._0;
    result[19] = answer.anchor._1;
    result[20] = answer.target.plan.v;
    result[21] = answer.target.plan.omega;
    result[22] = answer.target.plan.switch_;
    result[23] = answer.target.plan.v_then;
    result[24] = answer.target.plan.omega_then;
    result[25] = answer.target.plan.end;
    result[26] = answer.target.mode;
    result[27] = answer.target.room;
    result[28] = answer.target.owner;
    result[29] = answer.ahead;
}

double qpavoid_relaxation(double slack, double tolerance)
{
    (void)slack;
    (void)tolerance;
    return relaxation(slack, tolerance);
}

void qpavoid_repulsion_step(int law, const double *setup_edges, int setup_edges_rows,
    int setup_edges_columns, const double *setup_robot, int setup_robot_rows, const void
    *setup_settings, const double *request_obstacles_0, int request_obstacles_0_rows,
    int request_obstacles_0_columns, const double *request_obstacles_1, int
    request_obstacles_1_rows, int request_obstacles_1_columns, double request_age, bool
    request_ahead, double request_desired_0, double request_desired_1, double *state,
    int state_rows, double *contacts, int contacts_rows, int contacts_columns, double
    *result)
{
    (void)law;
    (void)setup_edges;
    (void)setup_edges_rows;
    (void)setup_edges_columns;
    (void)setup_robot;
    (void)setup_robot_rows;
    (void)setup_settings;
    (void)request_obstacles_0;
    (void)request_obstacles_0_rows;
    (void)request_obstacles_0_columns;
    (void)request_obstacles_1;
    (void)request_obstacles_1_rows;
    (void)request_obstacles_1_columns;
    (void)request_age;
    (void)request_ahead;
    (void)request_desired_0;
    (void)request_desired_1;
    (void)state;
    (void)state_rows;
    (void)contacts;
    (void)contacts_rows;
    (void)contacts_columns;
    const Outcome answer = repulsion_step(law, (const Setup[]){(Setup){(matrix){(double
        *)setup_edges, setup_edges_rows, setup_edges_columns}, (vector){(double
        *)setup_robot, setup_robot_rows}, (filter_settings)setup_settings}}, (const
        Request[]){(Request){(tuple_mm){(matrix){(double *)request_obstacles_0,
        request_obstacles_0_rows, request_obstacles_0_columns}, (matrix){(double
        *)request_obstacles_1, request_obstacles_1_rows, request_obstacles_1_columns}},
        request_age, request_ahead, (tuple_dd){request_desired_0, request_desired_1}}},
        (vector){state, state_rows}, (matrix){contacts, contacts_rows,
        contacts_columns});
    result[0] = answer.code;
    result[1] = answer.v;
    result[2] = answer.omega;
    result[3] = answer.clearance;
    result[4] = answer.slack;
    result[5] = answer.residual;
    result[6] = answer.shortfall;
    result[7] = answer.first;
    result[8] = answer.second;
}

void qpavoid_room_on_the_way(const double *setup_edges, int setup_edges_rows, int
    setup_edges_columns, const double *setup_robot, int setup_robot_rows, const void
    *setup_settings, double motion_pose_0, double motion_pose_1, double motion_pose_2,
    double motion_twist_0, double motion_twist_1, double motion_lateral, double
    motion_time, double motion_pace, const double *view_world_0, int view_world_0_rows,
    int view_world_0_columns, const double *view_world_1, int view_world_1_rows, int
    view_world_1_columns, double *view_seen_0, int view_seen_0_rows, int
    view_seen_0_columns, double *view_seen_1, int view_seen_1_rows, int
    view_seen_1_columns, double *view_contacts, int view_contacts_rows, int
    view_contacts_columns, double most, double *result)
{
    (void)setup_edges;
    (void)setup_edges_rows;
    (void)setup_edges_columns;
    (void)setup_robot;
    (void)setup_robot_rows;
    (void)setup_settings;
    (void)motion_pose_0;
    (void)motion_pose_1;
    (void)motion_pose_2;
    (void)motion_twist_0;
    (void)motion_twist_1;
    (void)motion_lateral;
    (void)motion_time;
    (void)motion_pace;
    (void)view_world_0;
    (void)view_world_0_rows;
    (void)view_world_0_columns;
    (void)view_world_1;
    (void)view_world_1_rows;
    (void)view_world_1_columns;
    (void)view_seen_0;
    (void)view_seen_0_rows;
    (void)view_seen_0_columns;
    (void)view_seen_1;
    (void)view_seen_1_rows;
    (void)view_seen_1_columns;
    (void)view_contacts;
    (void)view_contacts_rows;
    (void)view_contacts_columns;
    (void)most;
    const tuple_dd answer = room_on_the_way((const Setup[]){(Setup){(matrix){(double
        *)setup_edges, setup_edges_rows, setup_edges_columns}, (vector){(double
        *)setup_robot, setup_robot_rows}, (filter_settings)setup_settings}}, (const
        Motion[]){(Motion){(tuple_ddd){motion_pose_0, motion_pose_1, motion_pose_2},
        (tuple_dd){motion_twist_0, motion_twist_1}, motion_lateral, motion_time,
        motion_pace}}, (const View[]){(View){(tuple_mm){(matrix){(double *)view_world_0,
        view_world_0_rows, view_world_0_columns}, (matrix){(double *)view_world_1,
        view_world_1_rows, view_world_1_columns}}, (tuple_mm){(matrix){view_seen_0,
        view_seen_0_rows, view_seen_0_columns}, (matrix){view_seen_1, view_seen_1_rows,
        view_seen_1_columns}}, (matrix){view_contacts, view_contacts_rows,
        view_contacts_columns}}}, most);
    result[0] = answer._0;
    result[1] = answer._1;
}

void qpavoid_room_round(const double *setup_edges, int setup_edges_rows, int
    setup_edges_columns, const double *setup_robot, int setup_robot_rows, const void
    *setup_settings, double motion_pose_0, double motion_pose_1, double motion_pose_2,
    double motion_twist_0, double motion_twist_1, double motion_lateral, double
    motion_time, double motion_pace, const double *view_world_0, int view_world_0_rows,
    int view_world_0_columns, const double *view_world_1, int view_world_1_rows, int
    view_world_1_columns, double *view_seen_0, int view_seen_0_rows, int
    view_seen_0_columns, double *view_seen_1, int view_seen_1_rows, int
    view_seen_1_columns, double *view_contacts, int view_contacts_rows, int
    view_contacts_columns, double most, double *result)
{
    (void)setup_edges;
    (void)setup_edges_rows;
    (void)setup_edges_columns;
    (void)setup_robot;
    (void)setup_robot_rows;
    (void)setup_settings;
    (void)motion_pose_0;
    (void)motion_pose_1;
    (void)motion_pose_2;
    (void)motion_twist_0;
    (void)motion_twist_1;
    (void)motion_lateral;
    (void)motion_time;
    (void)motion_pace;
    (void)view_world_0;
    (void)view_world_0_rows;
    (void)view_world_0_columns;
    (void)view_world_1;
    (void)view_world_1_rows;
    (void)view_world_1_columns;
    (void)view_seen_0;
    (void)view_seen_0_rows;
    (void)view_seen_0_columns;
    (void)view_seen_1;
    (void)view_seen_1_rows;
    (void)view_seen_1_columns;
    (void)view_contacts;
    (void)view_contacts_rows;
    (void)view_contacts_columns;
    (void)most;
    const tuple_dd answer = room_round((const Setup[]){(Setup){(matrix){(double
        *)setup_edges, setup_edges_rows, setup_edges_columns}, (vector){(double
        *)setup_robot, setup_robot_rows}, (filter_settings)setup_settings}}, (const
        Motion[]){(Motion){(tuple_ddd){motion_pose_0, motion_pose_1, motion_pose_2},
        (tuple_dd){motion_twist_0, motion_twist_1}, motion_lateral, motion_time,
        motion_pace}}, (const View[]){(View){(tuple_mm){(matrix){(double *)view_world_0,
        view_world_0_rows, view_world_0_columns}, (matrix){(double *)view_world_1,
        view_world_1_rows, view_world_1_columns}}, (tuple_mm){(matrix){view_seen_0,
        view_seen_0_rows, view_seen_0_columns}, (matrix){view_seen_1, view_seen_1_rows,
        view_seen_1_columns}}, (matrix){view_contacts, view_contacts_rows,
        view_contacts_columns}}}, most);
    result[0] = answer._0;
    result[1] = answer._1;
}

void qpavoid_row_at(const double *plan, int plan_rows, int plan_columns, double place,
    double *result)
{
    (void)plan;
    (void)plan_rows;
    (void)plan_columns;
    (void)place;
    const Reference answer = row_at((matrix){(double *)plan, plan_rows, plan_columns},
        place);
    result[0] = answer.x;
    result[1] = answer.y;
    result[2] = answer.heading;
    result[3] = answer.v;
    result[4] = answer.omega;
}

double qpavoid_safety_radius(double speed, double curve_r_min_slow, double
    curve_r_min_fast, double curve_speed_low, double curve_speed_high)
{
    (void)speed;
    (void)curve_r_min_slow;
    (void)curve_r_min_fast;
    (void)curve_speed_low;
    (void)curve_speed_high;
    return safety_radius(speed, (const RadiusCurve[]){(RadiusCurve){curve_r_min_slow,
        curve_r_min_fast, curve_speed_low, curve_speed_high}});
}

int qpavoid_search_size(double half)
{
    (void)half;
    return search_size(half);
}

void qpavoid_set_driven(double *state, int state_rows, double v, double omega)
{
    (void)state;
    (void)state_rows;
    (void)v;
    (void)omega;
    set_driven((vector){state, state_rows}, v, omega);
}

void qpavoid_solve_exactly(double *rows, int rows_rows, int rows_columns, double
    terms_box_v_min, double terms_box_v_max, double terms_box_omega_min, double
    terms_box_omega_max, double terms_desired_0, double terms_desired_1, double
    terms_weights_0, double terms_weights_1, int terms_n_hard, double slack_tolerance,
    double *result)
{
    (void)rows;
    (void)rows_rows;
    (void)rows_columns;
    (void)terms_box_v_min;
    (void)terms_box_v_max;
    (void)terms_box_omega_min;
    (void)terms_box_omega_max;
    (void)terms_desired_0;
    (void)terms_desired_1;
    (void)terms_weights_0;
    (void)terms_weights_1;
    (void)terms_n_hard;
    (void)slack_tolerance;
    const Optimum answer = solve_exactly((matrix){rows, rows_rows, rows_columns}, (const
        Terms[]){(Terms){(Box){terms_box_v_min, terms_box_v_max, terms_box_omega_min,
        terms_box_omega_max}, (tuple_dd){terms_desired_0, terms_desired_1},
        (tuple_dd){terms_weights_0, terms_weights_1}, terms_n_hard}}, slack_tolerance);
    result[0] = answer.found;
    result[1] = answer.v;
    result[2] = answer.omega;
    result[3] = answer.slack;
    result[4] = answer.first;
    result[5] = answer.second;
}

double qpavoid_stopping_time(const double *robot_, int robot_rows, double v, double
    omega, double dt)
{
    (void)robot_;
    (void)robot_rows;
    (void)v;
    (void)omega;
    (void)dt;
    return stopping_time((vector){(double *)robot_, robot_rows}, v, omega, dt);
}

void qpavoid_track_step(const double *law, int law_rows, const double *robot_, int
    robot_rows, double pose_0, double pose_1, double pose_2, double reference_x, double
    reference_y, double reference_heading, double reference_v, double reference_omega,
    int mode, double *result)
{
    (void)law;
    (void)law_rows;
    (void)robot_;
    (void)robot_rows;
    (void)pose_0;
    (void)pose_1;
    (void)pose_2;
    (void)reference_x;
    (void)reference_y;
    (void)reference_heading;
    (void)reference_v;
    (void)reference_omega;
    (void)mode;
    const tuple_ddi answer = track_step((vector){(double *)law, law_rows},
        (vector){(double *)robot_, robot_rows}, (const tuple_ddd[]){(tuple_ddd){pose_0,
        pose_1, pose_2}}, (const Reference[]){(Reference){reference_x, reference_y,
        reference_heading, reference_v, reference_omega}}, mode);
    result[0] = answer._0;
    result[1] = answer._1;
    result[2] = answer._2;
}

void qpavoid_tracking_error(double pose_0, double pose_1, double pose_2, double
    target_0, double target_1, double target_2, double *result)
{
    (void)pose_0;
    (void)pose_1;
    (void)pose_2;
    (void)target_0;
    (void)target_1;
    (void)target_2;
    const tuple_ddd answer = tracking_error((const tuple_ddd[]){(tuple_ddd){pose_0,
        pose_1, pose_2}}, (const tuple_ddd[]){(tuple_ddd){target_0, target_1,
        target_2}});
    result[0] = answer._0;
    result[1] = answer._1;
    result[2] = answer._2;
}

void qpavoid_trust_box(int prepared_code, double prepared_clearance, int prepared_most,
    int prepared_bodies, int prepared_m, int prepared_n_hard, double prepared_last_0,
    double prepared_last_1, double prepared_box_v_min, double prepared_box_v_max, double
    prepared_box_omega_min, double prepared_box_omega_max, double prepared_wish_0,
    double prepared_wish_1, double prepared_desired_0, double prepared_desired_1, double
    prepared_rest_0, double prepared_rest_1, double prepared_anchor_0, double
    prepared_anchor_1, double prepared_target_plan_v, double prepared_target_plan_omega,
    double prepared_target_plan_switch, double prepared_target_plan_v_then, double
    prepared_target_plan_omega_then, double prepared_target_plan_end, double
    prepared_target_mode, double prepared_target_room, int prepared_target_owner, bool
    prepared_ahead, int attempt, double rejected_0, double rejected_1, double *result)
{
    (void)prepared_code;
    (void)prepared_clearance;
    (void)prepared_most;
    (void)prepared_bodies;
    (void)prepared_m;
    (void)prepared_n_hard;
    (void)prepared_last_0;
    (void)prepared_last_1;
    (void)prepared_box_v_min;
    (void)prepared_box_v_max;
    (void)prepared_box_omega_min;
    (void)prepared_box_omega_max;
    (void)prepared_wish_0;
    (void)prepared_wish_1;
    (void)prepared_desired_0;
    (void)prepared_desired_1;
    (void)prepared_rest_0;
    (void)prepared_rest_1;
    (void)prepared_anchor_0;
    (void)prepared_anchor_1;
    (void)prepared_target_plan_v;
    (void)prepared_target_plan_omega;
    (void)prepared_target_plan_switch;
    (void)prepared_target_plan_v_then;
    (void)prepared_target_plan_omega_then;
    (void)prepared_target_plan_end;
    (void)prepared_target_mode;
    (void)prepared_target_room;
    (void)prepared_target_owner;
    (void)prepared_ahead;
    (void)attempt;
    (void)rejected_0;
    (void)rejected_1;
    const Box answer = trust_box((const Prepared[]){(Prepared){prepared_code,
        prepared_clearance, prepared_most, prepared_bodies, prepared_m, prepared_n_hard,
        (tuple_dd){prepared_last_0, prepared_last_1}, (Box){prepared_box_v_min,
        prepared_box_v_max, prepared_box_omega_min, prepared_box_omega_max},
        (tuple_dd){prepared_wish_0, prepared_wish_1}, (tuple_dd){prepared_desired_0,
        prepared_desired_1}, (tuple_dd){prepared_rest_0, prepared_rest_1},
        (tuple_dd){prepared_anchor_0, prepared_anchor_1},
        (Target){(Plan){prepared_target_plan_v, prepared_target_plan_omega,
        prepared_target_plan_switch, prepared_target_plan_v_then,
        prepared_target_plan_omega_then, prepared_target_plan_end},
        prepared_target_mode, prepared_target_room, prepared_target_owner},
        prepared_ahead}}, attempt, (tuple_dd){rejected_0, rejected_1});
    result[0] = answer.v_min;
    result[1] = answer.v_max;
    result[2] = answer.omega_min;
    result[3] = answer.omega_max;
}

void qpavoid_twist_box(const double *robot_, int robot_rows, double v, double omega,
    double dt, double *result)
{
    (void)robot_;
    (void)robot_rows;
    (void)v;
    (void)omega;
    (void)dt;
    const Box answer = twist_box((vector){(double *)robot_, robot_rows}, v, omega, dt);
    result[0] = answer.v_min;
    result[1] = answer.v_max;
    result[2] = answer.omega_min;
    result[3] = answer.omega_max;
}

void qpavoid_unsolved(int code, double twist_0, double twist_1, double residual, double
    *result)
{
    (void)code;
    (void)twist_0;
    (void)twist_1;
    (void)residual;
    const Outcome answer = unsolved(code, (tuple_dd){twist_0, twist_1}, residual);
    result[0] = answer.code;
    result[1] = answer.v;
    result[2] = answer.omega;
    result[3] = answer.clearance;
    result[4] = answer.slack;
    result[5] = answer.residual;
    result[6] = answer.shortfall;
    result[7] = answer.first;
    result[8] = answer.second;
}

void qpavoid_waiting_reference(const double *plan, int plan_rows, int plan_columns,
    double place, double pose_0, double pose_1, double pose_2, double lags_0, double
    lags_1, double lags_2, double *result)
{
    (void)plan;
    (void)plan_rows;
    (void)plan_columns;
    (void)place;
    (void)pose_0;
    (void)pose_1;
    (void)pose_2;
    (void)lags_0;
    (void)lags_1;
    (void)lags_2;
    const tuple_Reference_d answer = waiting_reference((matrix){(double *)plan,
        plan_rows, plan_columns}, place, (const tuple_ddd[]){(tuple_ddd){pose_0, pose_1,
        pose_2}}, (const tuple_ddd[]){(tuple_ddd){lags_0, lags_1, lags_2}});
    result[0] = answer._0.x;
    result[1] = answer._0.y;
    result[2] = answer._0.heading;
    result[3] = answer._0.v;
    result[4] = answer._0.omega;
    result[5] = answer._1;
}

void qpavoid_wanted_distance(const void *settings_, double speed, double age, double
    *result)
{
    (void)settings_;
    (void)speed;
    (void)age;
    const tuple_dd answer = wanted_distance((filter_settings)settings_, speed, age);
    result[0] = answer._0;
    result[1] = answer._1;
}

double qpavoid_wrap_angle(double angle)
{
    (void)angle;
    return wrap_angle(angle);
}

#include <string.h>
#include <time.h>

/* What follows is the border to Python: arguments are checked and taken apart by the
 * program of their entry, a character a leaf, and results are put together.
 *
 *   d i b    a double, an int, a bool          n      None
 *   v V m M  a vector or a matrix, written     r R    a record, written
 *   ( )      a tuple                           < >    a named tuple, its number before
 *
 * The stable ABI of Python 3.11 is declared here, so that no headers need be there. */

typedef intptr_t Py_ssize_t;
typedef struct _object {
    Py_ssize_t references;
    const void *type;
} PyObject;
typedef struct {
    void *buf;
    PyObject *obj;
    Py_ssize_t len, itemsize;
    int readonly, ndim;
    char *format;
    Py_ssize_t *shape, *strides, *suboffsets;
    void *internal;
} Py_buffer;
typedef PyObject *(*PyCFunction)(PyObject *, PyObject *const *, Py_ssize_t);
typedef PyObject *(*newfunc)(PyObject *, PyObject *, PyObject *);
typedef struct { const char *name; PyCFunction call; int flags; const char *doc; } PyMethodDef;
typedef struct {
    Py_ssize_t references;
    void *type, *init;
    Py_ssize_t index;
    PyObject *copy;
    const char *name, *doc;
    Py_ssize_t size;
    PyMethodDef *methods;
    void *slots, *traverse, *clear, *free;
} PyModuleDef;
enum { METH_FASTCALL = 0x80, ABI = 3, TP_NEW = 65 };
enum { WRITABLE = 0x1, FORMAT = 0x4, CONTIGUOUS = 0x38 };

extern PyObject *PyExc_TypeError, *PyExc_ValueError, *PyExc_OverflowError, _Py_NoneStruct;
extern PyObject PyFloat_Type, PyLong_Type, PyTuple_Type;
extern PyObject *PyErr_Format(PyObject *, const char *, ...);
extern PyObject *PyErr_Occurred(void);
extern void PyErr_Clear(void);
extern void Py_IncRef(PyObject *);
extern void Py_DecRef(PyObject *);
extern double PyFloat_AsDouble(PyObject *);
extern PyObject *PyFloat_FromDouble(double);
extern long long PyLong_AsLongLong(PyObject *);
extern PyObject *PyLong_FromLong(long);
extern PyObject *PyBool_FromLong(long);
extern int PyObject_IsTrue(PyObject *);
extern int PyObject_GetBuffer(PyObject *, Py_buffer *, int);
extern void PyBuffer_Release(Py_buffer *);
extern PyObject *PyTuple_New(Py_ssize_t);
extern Py_ssize_t PyTuple_Size(PyObject *);
extern PyObject *PyTuple_GetItem(PyObject *, Py_ssize_t);
extern int PyTuple_SetItem(PyObject *, Py_ssize_t, PyObject *);
extern PyObject *PyImport_ImportModule(const char *);
extern PyObject *PyObject_GetAttrString(PyObject *, const char *);
extern void *PyType_GetSlot(PyObject *, int);
extern PyObject *PyUnicode_FromString(const char *);
extern const char *PyUnicode_AsUTF8AndSize(PyObject *, Py_ssize_t *);
extern PyObject *PyCapsule_New(void *, const char *, void (*)(PyObject *));
extern void *PyCapsule_GetPointer(PyObject *, const char *);
extern PyObject *PyCFunction_NewEx(PyMethodDef *, PyObject *, PyObject *);
extern unsigned long PyThread_get_thread_ident(void);
extern PyObject *PyModule_Create2(PyModuleDef *, int);
extern int PyModule_AddStringConstant(PyObject *, const char *, const char *);
extern void *PyEval_SaveThread(void);
extern void PyEval_RestoreThread(void *);

enum { MOST_SLOTS = 128, MOST_VIEWS = 24, MOST_NUMBERS = 128 };

/* Read-only numbers from which on other threads may run meanwhile. */
enum { LONG_CALL = 256 };

typedef struct { double number; double *at; int whole, rows, columns; } slot;

typedef struct {
    const char *name, *takes, *gives;
    int arguments;
    void (*call)(const slot *, double *);
} entry;

typedef struct {
    const entry *of;
    const char *at; /* in the program of the arguments */
    slot slots[MOST_SLOTS];
    Py_buffer views[MOST_VIEWS];
    int n_slots, n_views;
    int lasting; /* its buffers are its own */
    Py_ssize_t read; /* numbers of arrays that are not written */
} call;

static const struct { const char *module, *name; } classes[] = {{"qpavoid.avoidance.lanes", "Lane"}, {"qpavoid.model.contacts", "ObstacleContact"}, {"qpavoid.avoidance.ladder", "Outcome"}, {"qpavoid.avoidance.prediction", "Plan"}, {"qpavoid.model.robot", "RobotLimits"}, {"qpavoid.model.kinematics", "Frame"}, {"qpavoid.qp.exact", "Projection"}, {"qpavoid.model.contact", "Contact"}, {"qpavoid.avoidance.ladder", "Prepared"}, {"qpavoid.types", "Box"}, {"qpavoid.avoidance.target", "Target"}, {"qpavoid.tracking.kanayama", "Reference"}, {"qpavoid.qp.exact", "Optimum"}};
static PyObject *made[sizeof classes / sizeof *classes];
static newfunc new_tuple;

/* Buffers held of what is the same in every step: records, and arrays that nobody can
 * change. numpy takes 4 µs to describe a record anew. */
enum { HELD = 16 };
static Py_buffer held[HELD];
static int oldest;

/* The buffer of an array, which is held or is to be released; NULL: it is none. */
static const Py_buffer *buffer_of(PyObject *given, Py_buffer *view, int record, int written,
                                  int lasting)
{
    for (int i = 0; i < HELD && !written && !lasting; i++)
        if (held[i].obj == given)
            return &held[i];
    if (PyObject_GetBuffer(given, view, FORMAT | CONTIGUOUS | (written ? WRITABLE : 0))) {
        PyErr_Clear();
        return NULL;
    }
    const int same = record || (view->readonly && view->len < 4096);
    /* Who describes himself within the view cannot be held by a copy of it. */
    if (written || lasting || !same || view->obj != given || view->shape == &view->len)
        return view;
    Py_buffer *place = &held[oldest++ % HELD];
    if (oldest >= HELD)
        oldest = 0;
    if (place->obj)
        PyBuffer_Release(place);
    *place = *view;
    return place;
}

static int refuse(const call *c, PyObject *kind, const char *why)
{
    PyErr_Format(kind, "%s: argument %d: %s", c->of->name, c->n_slots + 1, why);
    return -1;
}

static int take_array(call *c, PyObject *given, char kind)
{
    const int written = kind == 'V' || kind == 'M' || kind == 'R';
    const int record = kind == 'r' || kind == 'R', wanted = kind == 'm' || kind == 'M' ? 2 : 1;
    slot *s = &c->slots[c->n_slots];
    const Py_buffer *view
        = buffer_of(given, &c->views[c->n_views], record, written, c->lasting);
    if (!view)
        return refuse(c, PyExc_TypeError,
                      written ? "a contiguous array is wanted that can be written"
                              : "a contiguous array is wanted");
    c->n_views += view == &c->views[c->n_views];
    if (view->ndim != wanted)
        return refuse(c, PyExc_ValueError, "an array of as many dimensions is wanted");
    s->at = (double *)view->buf;
    if (record) {
        const char *end = c->at; /* the size in bytes follows */
        int size = 0;
        while (*end >= '0' && *end <= '9')
            size = 10 * size + (*end++ - '0');
        c->at = end;
        if (view->itemsize != size || view->shape[0] != 1)
            return refuse(c, PyExc_TypeError, "one record of the right type is wanted");
        c->n_slots++;
        return 0;
    }
    if (view->itemsize != 8 || !view->format || view->format[0] != 'd' || view->format[1])
        return refuse(c, PyExc_TypeError, "an array of float64 is wanted");
    if (view->len / 8 > INT32_MAX || view->shape[0] > INT32_MAX
        || (wanted == 2 && view->shape[1] > INT32_MAX))
        return refuse(c, PyExc_OverflowError, "the array is too large");
    s->rows = (int)view->shape[0];
    s->columns = wanted == 2 ? (int)view->shape[1] : 1;
    if (!written)
        c->read += view->len / 8;
    c->n_slots++;
    return 0;
}

static int take(call *c, PyObject *given)
{
    slot *s = &c->slots[c->n_slots];
    switch (*c->at++) {
    case 'd':
        s->number = PyFloat_AsDouble(given);
        if (s->number == -1.0 && PyErr_Occurred())
            return -1;
        c->n_slots++;
        return 0;
    case 'i': {
        const long long whole = PyLong_AsLongLong(given);
        if (whole == -1 && PyErr_Occurred())
            return -1;
        if (whole < INT32_MIN || whole > INT32_MAX)
            return refuse(c, PyExc_OverflowError, "the integer is too large");
        s->whole = (int)whole;
        c->n_slots++;
        return 0;
    }
    case 'b':
        s->whole = PyObject_IsTrue(given);
        if (s->whole < 0)
            return -1;
        c->n_slots++;
        return 0;
    case '(': {
        const Py_ssize_t size = PyTuple_Size(given);
        Py_ssize_t i = 0;
        if (size < 0) {
            PyErr_Clear();
            return refuse(c, PyExc_TypeError, "a tuple is wanted");
        }
        for (; *c->at != ')'; i++) {
            if (i >= size)
                return refuse(c, PyExc_TypeError, "a tuple of more parts is wanted");
            if (take(c, PyTuple_GetItem(given, i)))
                return -1;
        }
        c->at++;
        if (i != size)
            return refuse(c, PyExc_TypeError, "a tuple of fewer parts is wanted");
        return 0;
    }
    default:
        return take_array(c, given, c->at[-1]);
    }
}

static PyObject *class_of(int number)
{
    if (!made[number]) {
        PyObject *module = PyImport_ImportModule(classes[number].module);
        if (!module)
            return NULL;
        made[number] = PyObject_GetAttrString(module, classes[number].name);
        Py_DecRef(module);
    }
    return made[number];
}

static PyObject *give(const char **at, const double **numbers)
{
    int number = -1;
    Py_ssize_t size = 0;
    const char *kind = (*at)++;
    switch (*kind) {
    case 'd':
        return PyFloat_FromDouble(*(*numbers)++);
    case 'i':
        return PyLong_FromLong((long)*(*numbers)++);
    case 'b':
        return PyBool_FromLong(*(*numbers)++ != 0.0);
    case 'n':
        Py_IncRef(&_Py_NoneStruct);
        return &_Py_NoneStruct;
    }
    if (*kind == '<') {
        number = 10 * ((*at)[0] - '0') + (*at)[1] - '0';
        *at += 2;
    }
    int deep = 0;
    for (const char *c = *at; deep > 0 || (*c != ')' && *c != '>'); c++) {
        size += deep == 0;
        deep += (*c == '(' || *c == '<') - (*c == ')' || *c == '>');
        if (*c == '<')
            c += 2;
    }
    PyObject *tuple = PyTuple_New(size);
    for (Py_ssize_t i = 0; tuple && i < size; i++) {
        PyObject *part = give(at, numbers);
        if (!part || PyTuple_SetItem(tuple, i, part)) {
            Py_DecRef(tuple);
            return NULL;
        }
    }
    (*at)++;
    if (!tuple || number < 0)
        return tuple;
    PyObject *of = class_of(number), *one = of ? PyTuple_New(1) : NULL, *named = NULL;
    if (one) {
        PyTuple_SetItem(one, 0, tuple);
        named = new_tuple(of, one, NULL);
        Py_DecRef(one);
    } else
        Py_DecRef(tuple);
    return named;
}

static void enter(const entry *of, const slot *slots, Py_ssize_t read, double *result)
{
    if (read >= LONG_CALL) {
        void *thread = PyEval_SaveThread();
        of->call(slots, result);
        PyEval_RestoreThread(thread);
    } else
        of->call(slots, result);
}

static PyObject *run(const entry *of, PyObject *const *given, Py_ssize_t count)
{
    call c;
    double result[MOST_NUMBERS];
    PyObject *answer = NULL;
    c.of = of, c.at = of->takes, c.n_slots = c.n_views = c.lasting = 0, c.read = 0;
    if (count != of->arguments)
        return PyErr_Format(PyExc_TypeError, "%s takes %d arguments, not %zd", of->name,
                            of->arguments, count);
    for (Py_ssize_t i = 0; i < count; i++)
        if (take(&c, given[i]))
            goto end;
    enter(of, c.slots, c.read, result);
    const char *gives = of->gives;
    const double *numbers = result;
    answer = give(&gives, &numbers);
end:
    for (int i = 0; i < c.n_views; i++)
        PyBuffer_Release(&c.views[i]);
    return answer;
}

static void call_activation(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_activation(s[0].whole, s[1].number, s[2].number, s[3].number);
}

static void call_arc(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_arc(s[0].number, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, r);
}

static void call_attempts(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_attempts(s[0].whole, s[1].number, s[2].whole, s[3].whole, s[4].whole, s[5].whole, s[6].number, s[7].number, s[8].number, s[9].number, s[10].number, s[11].number, s[12].number, s[13].number, s[14].number, s[15].number, s[16].number, s[17].number, s[18].number, s[19].number, s[20].number, s[21].number, s[22].number, s[23].number, s[24].number, s[25].number, s[26].number, s[27].number, s[28].whole, s[29].whole);
}

static void call_best_lane(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_best_lane(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[1].columns, s[2].at, s[2].rows, s[2].columns, s[3].at, s[3].rows, s[3].columns, s[4].at, s[4].rows, s[4].columns, s[5].at, s[5].rows, s[5].columns, s[6].number, s[7].number, s[8].number, s[9].number, s[10].number, s[11].number, s[12].number, s[13].number, r);
}

static void call_braking_twist(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_braking_twist(s[0].at, s[0].rows, s[1].number, s[2].number, s[3].number, r);
}

static void call_certificate(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_certificate(s[0].at, s[0].rows, s[0].columns, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, s[6].number, s[7].number, s[8].number, s[9].whole, s[10].number, s[11].number, s[12].number, r);
}

static void call_contact_at(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_contact_at(s[0].at, s[0].rows, s[0].columns, s[1].whole, r);
}

static void call_contact_table(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_contact_table(s[0].at, s[0].rows, s[0].columns, s[1].number, s[2].at, s[2].rows, s[2].columns, s[3].at, s[3].rows, s[3].columns, s[4].number, s[5].at, s[5].rows, s[5].columns, r);
}

static void call_decide(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_decide(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[2].at, s[3].whole, s[4].number, s[5].whole, s[6].whole, s[7].whole, s[8].whole, s[9].number, s[10].number, s[11].number, s[12].number, s[13].number, s[14].number, s[15].number, s[16].number, s[17].number, s[18].number, s[19].number, s[20].number, s[21].number, s[22].number, s[23].number, s[24].number, s[25].number, s[26].number, s[27].number, s[28].number, s[29].number, s[30].number, s[31].whole, s[32].whole, s[33].at, s[33].rows, s[34].whole, s[35].number, s[36].number, s[37].number, s[38].number, s[39].at, s[39].rows, r);
}

static void call_detour_step(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_detour_step(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[2].at, s[3].at, s[3].rows, s[4].at, s[5].at, s[5].rows, s[5].columns, s[6].at, s[6].rows, s[7].at, s[7].rows, s[7].columns, s[8].at, s[8].rows, s[9].at, s[9].rows, s[9].columns, s[10].at, s[10].rows, s[10].columns, s[11].number, s[12].number, s[13].number, s[14].number, s[15].number, s[16].number, s[17].number, s[18].number, s[19].number, s[20].at, s[20].rows, s[20].columns, r);
}

static void call_differs(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_differs(s[0].number, s[1].number, s[2].number, s[3].number);
}

static void call_driven_twist(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_driven_twist(s[0].at, s[0].rows, s[1].number, s[2].number, r);
}

static void call_eq5(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_eq5(s[0].number, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, r);
}

static void call_eq7(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_eq7(s[0].number, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, r);
}

static void call_fill_ahead(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_fill_ahead(s[0].at, s[0].rows, s[0].columns, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, s[6].at, s[6].rows, s[6].columns);
}

static void call_fill_capsules(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_fill_capsules(s[0].whole, s[1].at, s[1].rows, s[1].columns, s[2].at, s[2].rows, s[2].columns, s[3].at, s[3].rows, s[3].columns, s[4].at, s[4].rows, s[4].columns, s[5].at, s[5].rows, s[5].columns, s[6].at, s[6].rows, s[6].columns, s[7].at, s[7].rows, s[7].columns);
}

static void call_fill_places(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_fill_places(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[2].at, s[3].number, s[4].number, s[5].number, s[6].number, s[7].number, s[8].number, s[9].number, s[10].number, s[11].at, s[11].rows, s[12].at, s[12].rows, s[12].columns, s[13].at, s[13].rows, s[13].columns);
}

static void call_filter_step(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_filter_step(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[2].at, s[3].at, s[3].rows, s[3].columns, s[4].at, s[4].rows, s[4].columns, s[5].number, s[6].whole, s[7].number, s[8].number, s[9].at, s[9].rows, s[10].at, s[10].rows, r);
}

static void call_free_share(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_free_share(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[1].columns, s[2].at, s[2].rows, s[2].columns, s[3].at, s[3].rows, s[3].columns, s[4].at, s[4].rows, s[4].columns, s[5].at, s[5].rows, s[5].columns, s[6].number, s[7].number, s[8].number, s[9].number, s[10].number, s[11].number, s[12].number, s[13].number, s[14].number, s[15].number, s[16].number, s[17].number);
}

static void call_greatest_pace(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_greatest_pace(s[0].at, s[0].rows, s[1].number, s[2].number, s[3].number);
}

static void call_greatest_speed(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_greatest_speed(s[0].at, s[0].rows, s[0].columns);
}

static void call_half_planes(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_half_planes(s[0].at, s[0].rows, s[0].columns, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, s[6].number, s[7].number, s[8].number, s[9].whole);
}

static void call_has_length(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_has_length(s[0].at, s[0].rows, s[0].columns, s[1].whole);
}

static void call_in_robot_frame(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_in_robot_frame(s[0].number, s[1].number, s[2].number, s[3].number, s[4].at, s[4].rows, s[4].columns, s[5].at, s[5].rows, s[5].columns, s[6].at, s[6].rows, s[6].columns, s[7].at, s[7].rows, s[7].columns);
}

static void call_integrate(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_integrate(s[0].number, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, s[6].number, r);
}

static void call_is_over(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_is_over(s[0].number, s[1].number, s[2].at, s[3].number);
}

static void call_kanayama(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_kanayama(s[0].number, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, s[6].number, s[7].number, r);
}

static void call_kept_plan(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_kept_plan(s[0].at, s[0].rows, r);
}

static void call_leads_on(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_leads_on(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[1].columns, s[2].at, s[2].rows, s[2].columns, s[3].at, s[3].rows, s[3].columns, s[4].at, s[4].rows, s[4].columns, s[5].at, s[5].rows, s[5].columns, s[6].number, s[7].number, s[8].number, s[9].number, s[10].number, s[11].number, s[12].number, s[13].number, s[14].number, s[15].number);
}

static void call_limit_twist(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_limit_twist(s[0].at, s[0].rows, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, r);
}

static void call_limits_of(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_limits_of(s[0].at, s[0].rows, r);
}

static void call_look_ticks(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_look_ticks(s[0].at);
}

static void call_memory_size(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_memory_size(s[0].whole, s[1].at);
}

static void call_most_arcs(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_most_arcs(s[0].at);
}

static void call_most_contacts(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_most_contacts(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[1].columns, s[2].at, s[2].rows, s[2].columns);
}

static void call_most_sides(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_most_sides(s[0].whole);
}

static void call_moved_on(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_moved_on(s[0].number, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, s[6].number, r);
}

static void call_nearest(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_nearest(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[1].columns, s[2].at, s[2].rows, s[2].columns, s[3].at, s[3].rows, s[3].columns, s[4].at, s[4].rows, s[4].columns, s[5].at, s[5].rows, s[5].columns, s[6].number, s[7].number, s[8].number, s[9].number, s[10].number, s[11].number, s[12].number, s[13].number, s[14].number, r);
}

static void call_nearest_distance(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_nearest_distance(s[0].at, s[0].rows, s[0].columns, s[1].whole);
}

static void call_nearest_point(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_nearest_point(s[0].at, s[0].rows, s[0].columns, s[1].number, s[2].number, s[3].number, r);
}

static void call_note_arrival(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_note_arrival(s[0].at, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, s[6].number, s[7].number, s[8].number, s[9].number);
}

static void call_point_contact(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_point_contact(s[0].at, s[0].rows, s[0].columns, s[1].number, s[2].number, r);
}

static void call_prepare(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_prepare(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[2].at, s[3].at, s[3].rows, s[3].columns, s[4].at, s[4].rows, s[4].columns, s[5].number, s[6].whole, s[7].number, s[8].number, s[9].at, s[9].rows, s[10].at, s[10].rows, r);
}

static void call_relaxation(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_relaxation(s[0].number, s[1].number);
}

static void call_repulsion_step(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_repulsion_step(s[0].whole, s[1].at, s[1].rows, s[1].columns, s[2].at, s[2].rows, s[3].at, s[4].at, s[4].rows, s[4].columns, s[5].at, s[5].rows, s[5].columns, s[6].number, s[7].whole, s[8].number, s[9].number, s[10].at, s[10].rows, s[11].at, s[11].rows, s[11].columns, r);
}

static void call_room_on_the_way(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_room_on_the_way(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[2].at, s[3].number, s[4].number, s[5].number, s[6].number, s[7].number, s[8].number, s[9].number, s[10].number, s[11].at, s[11].rows, s[11].columns, s[12].at, s[12].rows, s[12].columns, s[13].at, s[13].rows, s[13].columns, s[14].at, s[14].rows, s[14].columns, s[15].at, s[15].rows, s[15].columns, s[16].number, r);
}

static void call_room_round(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_room_round(s[0].at, s[0].rows, s[0].columns, s[1].at, s[1].rows, s[2].at, s[3].number, s[4].number, s[5].number, s[6].number, s[7].number, s[8].number, s[9].number, s[10].number, s[11].at, s[11].rows, s[11].columns, s[12].at, s[12].rows, s[12].columns, s[13].at, s[13].rows, s[13].columns, s[14].at, s[14].rows, s[14].columns, s[15].at, s[15].rows, s[15].columns, s[16].number, r);
}

static void call_row_at(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_row_at(s[0].at, s[0].rows, s[0].columns, s[1].number, r);
}

static void call_safety_radius(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_safety_radius(s[0].number, s[1].number, s[2].number, s[3].number, s[4].number);
}

static void call_search_size(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_search_size(s[0].number);
}

static void call_set_driven(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_set_driven(s[0].at, s[0].rows, s[1].number, s[2].number);
}

static void call_solve_exactly(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_solve_exactly(s[0].at, s[0].rows, s[0].columns, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, s[6].number, s[7].number, s[8].number, s[9].whole, s[10].number, r);
}

static void call_stopping_time(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_stopping_time(s[0].at, s[0].rows, s[1].number, s[2].number, s[3].number);
}

static void call_track_step(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_track_step(s[0].at, s[0].rows, s[1].at, s[1].rows, s[2].number, s[3].number, s[4].number, s[5].number, s[6].number, s[7].number, s[8].number, s[9].number, s[10].whole, r);
}

static void call_tracking_error(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_tracking_error(s[0].number, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, r);
}

static void call_trust_box(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_trust_box(s[0].whole, s[1].number, s[2].whole, s[3].whole, s[4].whole, s[5].whole, s[6].number, s[7].number, s[8].number, s[9].number, s[10].number, s[11].number, s[12].number, s[13].number, s[14].number, s[15].number, s[16].number, s[17].number, s[18].number, s[19].number, s[20].number, s[21].number, s[22].number, s[23].number, s[24].number, s[25].number, s[26].number, s[27].number, s[28].whole, s[29].whole, s[30].whole, s[31].number, s[32].number, r);
}

static void call_twist_box(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_twist_box(s[0].at, s[0].rows, s[1].number, s[2].number, s[3].number, r);
}

static void call_unsolved(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_unsolved(s[0].whole, s[1].number, s[2].number, s[3].number, r);
}

static void call_waiting_reference(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_waiting_reference(s[0].at, s[0].rows, s[0].columns, s[1].number, s[2].number, s[3].number, s[4].number, s[5].number, s[6].number, s[7].number, r);
}

static void call_wanted_distance(const slot *s, double *r)
{
    (void)s, (void)r;
    qpavoid_wanted_distance(s[0].at, s[1].number, s[2].number, r);
}

static void call_wrap_angle(const slot *s, double *r)
{
    (void)s, (void)r;
    r[0] = qpavoid_wrap_angle(s[0].number);
}

static const entry entries[] = {
    {"activation", "iddd", "d", 4, call_activation},
    {"arc", "dddddd", "(ddd)", 6, call_arc},
    {"attempts", "(idiiii(dd)(dddd)(dd)(dd)(dd)(dd)((dddddd)ddi)b)", "i", 1, call_attempts},
    {"best_lane", "(m(mm)(MM)Mdddddd)dd", "<00dddd>", 3, call_best_lane},
    {"braking_twist", "vddd", "(dd)", 4, call_braking_twist},
    {"certificate", "m((dddd)(dd)(dd)i)d(dd)", "(dd)", 4, call_certificate},
    {"contact_at", "mi", "<01dddddddii>", 2, call_contact_at},
    {"contact_table", "md(mm)dM", "(ii)", 5, call_contact_table},
    {"decide", "(mvr232)(idiiii(dd)(dddd)(dd)(dd)(dd)(dd)((dddddd)ddi)b)Vi(dd)(dd)V", "<02iddddddii>", 7, call_decide},
    {"detour_step", "((mvr232)vr208m)V(MV)(mm)((dd)(ddd)d(dd)dm)", "(idd)", 5, call_detour_step},
    {"differs", "(dd)(dd)", "b", 2, call_differs},
    {"driven_twist", "vdd", "(dd)", 3, call_driven_twist},
    {"eq5", "dddddd", "(dd)", 6, call_eq5},
    {"eq7", "dddddd", "(dd)", 6, call_eq7},
    {"fill_ahead", "md(ddd)dM", "n", 5, call_fill_ahead},
    {"fill_capsules", "immmmmmM", "i", 8, call_fill_capsules},
    {"fill_places", "(mvr232)(dddddd)(dd)vMM", "d", 6, call_fill_places},
    {"filter_step", "mvr232mmdbddVV", "(iddddddii)", 11, call_filter_step},
    {"free_share", "(m(mm)(MM)Mdddddd)(ddd)(dd)d", "d", 4, call_free_share},
    {"greatest_pace", "vddd", "d", 4, call_greatest_pace},
    {"greatest_speed", "m", "d", 1, call_greatest_speed},
    {"half_planes", "M((dddd)(dd)(dd)i)", "d", 2, call_half_planes},
    {"has_length", "mi", "b", 2, call_has_length},
    {"in_robot_frame", "(ddd)d(mm)(MM)", "n", 4, call_in_robot_frame},
    {"integrate", "(ddd)(dd)dd", "(ddd)", 4, call_integrate},
    {"is_over", "ddR120d", "b", 4, call_is_over},
    {"kanayama", "(ddd)(dd)(ddd)", "(dd)", 3, call_kanayama},
    {"kept_plan", "v", "<03dddddd>", 1, call_kept_plan},
    {"leads_on", "(m(mm)(MM)Mdddddd)(ddd)d", "b", 3, call_leads_on},
    {"limit_twist", "v(dd)(dd)d", "(dd)", 4, call_limit_twist},
    {"limits_of", "v", "<04ddddddddd>", 1, call_limits_of},
    {"look_ticks", "r232", "i", 1, call_look_ticks},
    {"memory_size", "ir232", "i", 2, call_memory_size},
    {"most_arcs", "r232", "i", 1, call_most_arcs},
    {"most_contacts", "m(mm)", "i", 2, call_most_contacts},
    {"most_sides", "i", "i", 1, call_most_sides},
    {"moved_on", "(dddd)ddd", "<05dddd>", 4, call_moved_on},
    {"nearest", "(m(mm)(MM)Mdddddd)(ddd)", "(dd)", 2, call_nearest},
    {"nearest_distance", "mi", "d", 2, call_nearest_distance},
    {"nearest_point", "mddd", "<06bddiid>", 4, call_nearest_point},
    {"note_arrival", "R120((ddd)dd)(ddd)d", "n", 4, call_note_arrival},
    {"point_contact", "mdd", "<07dddddi>", 3, call_point_contact},
    {"prepare", "(mvr232)((mm)db(dd))VV", "<08idiiii(dd)<09dddd>(dd)(dd)(dd)(dd)<10<03dddddd>ddi>b>", 4, call_prepare},
    {"relaxation", "dd", "d", 2, call_relaxation},
    {"repulsion_step", "i(mvr232)((mm)db(dd))VM", "<02iddddddii>", 5, call_repulsion_step},
    {"room_on_the_way", "(mvr232)((ddd)(dd)ddd)((mm)(MM)M)d", "(dd)", 4, call_room_on_the_way},
    {"room_round", "(mvr232)((ddd)(dd)ddd)((mm)(MM)M)d", "(dd)", 4, call_room_round},
    {"row_at", "md", "<11ddddd>", 2, call_row_at},
    {"safety_radius", "d(dddd)", "d", 2, call_safety_radius},
    {"search_size", "d", "i", 1, call_search_size},
    {"set_driven", "Vdd", "n", 3, call_set_driven},
    {"solve_exactly", "M((dddd)(dd)(dd)i)d", "<12bdddii>", 3, call_solve_exactly},
    {"stopping_time", "vddd", "d", 4, call_stopping_time},
    {"track_step", "vv(ddd)(ddddd)i", "(ddi)", 5, call_track_step},
    {"tracking_error", "(ddd)(ddd)", "(ddd)", 2, call_tracking_error},
    {"trust_box", "(idiiii(dd)(dddd)(dd)(dd)(dd)(dd)((dddddd)ddi)b)i(dd)", "<09dddd>", 3, call_trust_box},
    {"twist_box", "vddd", "<09dddd>", 4, call_twist_box},
    {"unsolved", "i(dd)d", "<02iddddddii>", 3, call_unsolved},
    {"waiting_reference", "md(ddd)(ddd)", "(<11ddddd>d)", 4, call_waiting_reference},
    {"wanted_distance", "r232dd", "(dd)", 3, call_wanted_distance},
    {"wrap_angle", "d", "d", 1, call_wrap_angle}
};

static PyObject *py_activation(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[0], a, n);
}

static PyObject *py_arc(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[1], a, n);
}

static PyObject *py_attempts(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[2], a, n);
}

static PyObject *py_best_lane(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[3], a, n);
}

static PyObject *py_braking_twist(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[4], a, n);
}

static PyObject *py_certificate(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[5], a, n);
}

static PyObject *py_contact_at(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[6], a, n);
}

static PyObject *py_contact_table(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[7], a, n);
}

static PyObject *py_decide(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[8], a, n);
}

static PyObject *py_detour_step(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[9], a, n);
}

static PyObject *py_differs(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[10], a, n);
}

static PyObject *py_driven_twist(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[11], a, n);
}

static PyObject *py_eq5(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[12], a, n);
}

static PyObject *py_eq7(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[13], a, n);
}

static PyObject *py_fill_ahead(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[14], a, n);
}

static PyObject *py_fill_capsules(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[15], a, n);
}

static PyObject *py_fill_places(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[16], a, n);
}

static PyObject *py_filter_step(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[17], a, n);
}

static PyObject *py_free_share(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[18], a, n);
}

static PyObject *py_greatest_pace(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[19], a, n);
}

static PyObject *py_greatest_speed(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[20], a, n);
}

static PyObject *py_half_planes(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[21], a, n);
}

static PyObject *py_has_length(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[22], a, n);
}

static PyObject *py_in_robot_frame(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[23], a, n);
}

static PyObject *py_integrate(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[24], a, n);
}

static PyObject *py_is_over(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[25], a, n);
}

static PyObject *py_kanayama(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[26], a, n);
}

static PyObject *py_kept_plan(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[27], a, n);
}

static PyObject *py_leads_on(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[28], a, n);
}

static PyObject *py_limit_twist(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[29], a, n);
}

static PyObject *py_limits_of(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[30], a, n);
}

static PyObject *py_look_ticks(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[31], a, n);
}

static PyObject *py_memory_size(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[32], a, n);
}

static PyObject *py_most_arcs(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[33], a, n);
}

static PyObject *py_most_contacts(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[34], a, n);
}

static PyObject *py_most_sides(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[35], a, n);
}

static PyObject *py_moved_on(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[36], a, n);
}

static PyObject *py_nearest(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[37], a, n);
}

static PyObject *py_nearest_distance(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[38], a, n);
}

static PyObject *py_nearest_point(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[39], a, n);
}

static PyObject *py_note_arrival(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[40], a, n);
}

static PyObject *py_point_contact(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[41], a, n);
}

static PyObject *py_prepare(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[42], a, n);
}

static PyObject *py_relaxation(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[43], a, n);
}

static PyObject *py_repulsion_step(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[44], a, n);
}

static PyObject *py_room_on_the_way(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[45], a, n);
}

static PyObject *py_room_round(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[46], a, n);
}

static PyObject *py_row_at(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[47], a, n);
}

static PyObject *py_safety_radius(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[48], a, n);
}

static PyObject *py_search_size(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[49], a, n);
}

static PyObject *py_set_driven(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[50], a, n);
}

static PyObject *py_solve_exactly(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[51], a, n);
}

static PyObject *py_stopping_time(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[52], a, n);
}

static PyObject *py_track_step(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[53], a, n);
}

static PyObject *py_tracking_error(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[54], a, n);
}

static PyObject *py_trust_box(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[55], a, n);
}

static PyObject *py_twist_box(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[56], a, n);
}

static PyObject *py_unsolved(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[57], a, n);
}

static PyObject *py_waiting_reference(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[58], a, n);
}

static PyObject *py_wanted_distance(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[59], a, n);
}

static PyObject *py_wrap_angle(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    return run(&entries[60], a, n);
}

/* A filter's call, of which most is the same every time: that is taken apart once, and
 * its buffers are held as long as the call lives. What comes with each call has to be
 * just what is expected: floats, an array of numpy, and for all else the very objects
 * that stand for nothing. Where it is not, in another thread, and where the machine code
 * wants more memory or finds something invalid, the answer is None: Python then takes the
 * long way, and says what is wrong. */

enum { MOST_GIVEN = 16, FIELDS = 11 }; /* of a Decision */
enum { r_code, r_v, r_omega, r_clearance, r_slack, r_residual, r_shortfall, r_first, r_second };

typedef struct {
    call known;
    struct {
        PyObject *same; /* what has to be given; NULL: what fills a slot */
        int slot;
    } given[MOST_GIVEN];
    int count, rows; /* which of them is the array */
    unsigned long thread;
    PyObject *kept, *array, *decision, *statuses; /* borrowed of the first, but it */
    PyObject *one, *fields, *zero, *none_active;  /* (fields,), and what is in them */
} bound_call;

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int are_bits(double x, double y)
{
    return !memcmp(&x, &y, sizeof x);
}

/* A float, for which one of the same bits may stand. */
static PyObject *as_float(const bound_call *b, double x, PyObject *same)
{
    PyObject *found = are_bits(x, 0.0) ? b->zero : same;
    if (!found || !are_bits(x, PyFloat_AsDouble(found)))
        return PyFloat_FromDouble(x);
    Py_IncRef(found);
    return found;
}

static PyObject *as_active(const bound_call *b, int first, int second)
{
    const int owners[2] = {first >= 0 ? first : second, second};
    const int many = (first >= 0) + (second >= 0 && second != first);
    if (!many)
        Py_IncRef(b->none_active);
    PyObject *active = many ? PyTuple_New(many) : b->none_active;
    for (int i = 0; active && i < many; i++) {
        PyObject *obstacle = PyLong_FromLong(owners[i]);
        if (!obstacle || PyTuple_SetItem(active, i, obstacle)) {
            Py_DecRef(active);
            return NULL;
        }
    }
    return active;
}

/* The fields of a Decision, in their order; lateral and problem stay as they are. */
static PyObject *as_decision(bound_call *b, const double *r, PyObject *const *given, double began)
{
    PyObject *status = PyTuple_GetItem(b->statuses, (Py_ssize_t)r[r_code]);
    if (!status)
        return NULL;
    Py_IncRef(status);
    PyObject *parts[] = {as_float(b, r[r_v], given[0]),
                        as_float(b, r[r_omega], given[1]),
                        status,
                        PyFloat_FromDouble(r[r_clearance]),
                        as_float(b, r[r_slack], NULL),
                        as_float(b, r[r_residual], NULL),
                        as_active(b, (int)r[r_first], (int)r[r_second]),
                        PyFloat_FromDouble(seconds() - began),
                        as_float(b, r[r_shortfall], NULL)};
    int whole = 1;
    for (Py_ssize_t i = 0; i < (Py_ssize_t)(sizeof parts / sizeof *parts); i++) {
        whole = whole && parts[i];
        if (parts[i])
            whole = !PyTuple_SetItem(b->fields, i, parts[i]) && whole;
    }
    return whole ? new_tuple(b->decision, b->one, NULL) : NULL;
}

/* An array of numpy's own, of float64 in rows of so many, one after another. */
static int take_rows(const bound_call *b, PyObject *given, int columns, slot *s, Py_buffer *view)
{
    if (given->type != b->array || PyObject_GetBuffer(given, view, FORMAT | CONTIGUOUS)) {
        PyErr_Clear();
        return -1;
    }
    if (view->ndim == 2 && view->shape[1] == columns && view->shape[0] <= INT32_MAX / columns
        && view->itemsize == 8 && view->format && view->format[0] == 'd' && !view->format[1]
        && (uintptr_t)view->buf % sizeof(double) == 0) {
        s->at = (double *)view->buf;
        s->rows = (int)view->shape[0];
        return 0;
    }
    PyBuffer_Release(view);
    return -1;
}

/* Take what is given, and the buffer of its array. */
static int take_given(bound_call *b, PyObject *const *a, Py_buffer *view)
{
    for (int i = 0; i < b->count; i++) {
        PyObject *same = b->given[i].same;
        if (i == b->rows || a[i] == same)
            continue;
        if (a[i]->type != &PyFloat_Type)
            return -1;
        const double number = PyFloat_AsDouble(a[i]);
        if (!same)
            b->known.slots[b->given[i].slot].number = number;
        else if (same->type != &PyFloat_Type || !are_bits(number, PyFloat_AsDouble(same)))
            return -1;
    }
    slot *s = &b->known.slots[b->given[b->rows].slot];
    return take_rows(b, a[b->rows], s->columns, s, view);
}

static PyObject *call_bound(PyObject *self, PyObject *const *a, Py_ssize_t n)
{
    bound_call *b = PyCapsule_GetPointer(self, NULL);
    PyObject *answer = &_Py_NoneStruct;
    Py_buffer view;
    double result[MOST_NUMBERS];
    if (!b)
        return NULL;
    if (n == b->count && PyThread_get_thread_ident() == b->thread) {
        const double began = seconds();
        if (!take_given(b, a, &view)) {
            enter(b->known.of, b->known.slots, b->known.read + view.len / 8, result);
            PyBuffer_Release(&view);
            if (result[r_code] >= 0.0)
                return as_decision(b, result, a, began);
        }
    }
    Py_IncRef(answer);
    return answer;
}

static PyMethodDef bound_method = {"bound", call_bound, METH_FASTCALL, "See bind."};

static void unbind(PyObject *capsule)
{
    bound_call *b = PyCapsule_GetPointer(capsule, NULL);
    for (int i = 0; i < b->known.n_views; i++)
        PyBuffer_Release(&b->known.views[i]);
    Py_DecRef(b->one);
    Py_DecRef(b->zero);
    Py_DecRef(b->none_active);
    Py_DecRef(b->kept);
    free(b);
}

/* Take what is known: an entry's arguments, one after another. */
static int take_known(bound_call *b, PyObject *known, int *slots)
{
    if (PyTuple_Size(known) != b->known.of->arguments)
        return refuse(&b->known, PyExc_TypeError, "all arguments are wanted");
    for (int i = 0; i < b->known.of->arguments; i++) {
        slots[i] = b->known.n_slots;
        if (take(&b->known, PyTuple_GetItem(known, i)))
            return -1;
    }
    return 0;
}

/* Take note of what comes with each call: the number of the argument that it fills, v and
 * ω first, or what is given in place of nothing. */
static int take_pattern(bound_call *b, PyObject *given, const int *slots)
{
    b->count = (int)PyTuple_Size(given), b->rows = -1;
    if (b->count < 2 || b->count > MOST_GIVEN)
        return refuse(&b->known, PyExc_TypeError, "too little or too much is given");
    for (int i = 0; i < b->count; i++) {
        PyObject *one = PyTuple_GetItem(given, i);
        const long long number = one->type == &PyLong_Type ? PyLong_AsLongLong(one) : -1;
        if (number >= 0 && number < b->known.of->arguments) {
            b->given[i].slot = slots[number];
            if (b->known.slots[slots[number]].columns)
                b->rows = i;
        } else
            b->given[i].same = one;
    }
    return b->rows < 2 ? refuse(&b->known, PyExc_TypeError, "no array is given") : 0;
}

/* bind(name, arguments, given, (ndarray, Decision, statuses)): the call of an entry of
 * which the arguments are known but for those that are given. */
static PyObject *bind(PyObject *m, PyObject *const *a, Py_ssize_t n)
{
    (void)m;
    const char *name = n == 4 ? PyUnicode_AsUTF8AndSize(a[0], NULL) : NULL;
    const entry *of = NULL;
    for (size_t i = 0; name && i < sizeof entries / sizeof *entries; i++)
        if (!strcmp(entries[i].name, name))
            of = &entries[i];
    bound_call *b = of ? calloc(1, sizeof *b) : NULL;
    PyObject *capsule = b ? PyCapsule_New(b, NULL, unbind) : NULL, *bound = NULL;
    int slots[MOST_SLOTS];
    if (!capsule) {
        free(b);
        return PyErr_Format(PyExc_TypeError, "bind: an entry and three tuples are wanted");
    }
    b->known.of = of, b->known.at = of->takes, b->known.lasting = 1;
    b->thread = PyThread_get_thread_ident();
    b->kept = PyTuple_New(3), b->one = PyTuple_New(1), b->fields = PyTuple_New(FIELDS);
    b->none_active = PyTuple_New(0), b->zero = PyFloat_FromDouble(0.0);
    for (int i = 0; b->kept && i < 3; i++) {
        Py_IncRef(a[i + 1]);
        PyTuple_SetItem(b->kept, i, a[i + 1]);
    }
    if (b->kept && b->one && b->fields && b->zero) {
        PyTuple_SetItem(b->one, 0, b->fields);
        Py_IncRef(b->zero);
        PyTuple_SetItem(b->fields, FIELDS - 2, b->zero);
        PyTuple_SetItem(b->fields, FIELDS - 1, PyUnicode_FromString(""));
        b->array = PyTuple_GetItem(a[3], 0), b->decision = PyTuple_GetItem(a[3], 1);
        b->statuses = PyTuple_GetItem(a[3], 2);
        if (!b->statuses)
            refuse(&b->known, PyExc_TypeError, "a type, a class and a tuple are wanted");
        else if (!take_known(b, a[1], slots) && !take_pattern(b, a[2], slots))
            bound = PyCFunction_NewEx(&bound_method, capsule, NULL);
    }
    Py_DecRef(capsule);
    return bound;
}

static PyMethodDef methods[] = {
    {"activation", py_activation, METH_FASTCALL, "Return the share of ẋ_0 that acts at a distance, from 0 (d ≥ r) to 1 (d ≤ r_min)."},
    {"arc", py_arc, METH_FASTCALL, "Return the pose after driving a constant twist for ``dt``: Eq. 1 integrated."},
    {"attempts", py_attempts, METH_FASTCALL, "Return how often the QP is solved at most: not where no single twist will do."},
    {"best_lane", py_best_lane, METH_FASTCALL, "Return the nearest lane after backing up so far, m; the right of two as near."},
    {"braking_twist", py_braking_twist, METH_FASTCALL, "Return u_b, the next twist when braking from (v, ω) along its arc."},
    {"certificate", py_certificate, METH_FASTCALL, "Return (violation, suboptimality) of a twist, judged from the problem alone."},
    {"contact_at", py_contact_at, METH_FASTCALL, "Return a row of the table."},
    {"contact_table", py_contact_table, METH_FASTCALL, "Fill ``contacts`` with those within reach, and always the nearest one."},
    {"decide", py_decide, METH_FASTCALL, "Return the outcome of an attempt, or :data:`AGAIN` with the twist rejected."},
    {"detour_step", py_detour_step, METH_FASTCALL, "Return a number of :data:`PROGRESS` and the twist to desire, m/s and rad/s."},
    {"differs", py_differs, METH_FASTCALL, "Return whether a twist is not what the robot would drive if it were alone."},
    {"driven_twist", py_driven_twist, METH_FASTCALL, "Return what a robot drives that is said to drive (v, ω): the nearest it can."},
    {"eq5", py_eq5, METH_FASTCALL, "Return J_0⁻¹ ẋ_0 d̂_o, the repulsive twist of Eq. 5, with d̂_o = −n."},
    {"eq7", py_eq7, METH_FASTCALL, "Return the repulsive twist of Eq. 7, corrected: (0, ẋ_0/(p_y cos α − p_x sin α))."},
    {"fill_ahead", py_fill_ahead, METH_FASTCALL, "Fill in the reference ahead, robot frame, a row a tick from a place on."},
    {"fill_capsules", py_fill_capsules, METH_FASTCALL, "Fill in the table, and say which polygon is none: convex, counter-clockwise."},
    {"fill_places", py_fill_places, METH_FASTCALL, "Fill in where a robot is at times (n,); return when it stands, s."},
    {"filter_step", py_filter_step, METH_FASTCALL, "Do :func:`filter_outcome`, for Python."},
    {"free_share", py_free_share, METH_FASTCALL, "Return the share of a time for which a twist may be held from a pose."},
    {"greatest_pace", py_greatest_pace, METH_FASTCALL, "Return how fast a distance can shrink while (v, ω) is driven, m/s."},
    {"greatest_speed", py_greatest_speed, METH_FASTCALL, "Return the greatest :func:`speed_bound`, m/s; 0 if there is no capsule."},
    {"half_planes", py_half_planes, METH_FASTCALL, "Fill in n·z ≥ c − s·softness for rows and limits, and return a least s, m/s."},
    {"has_length", py_has_length, METH_FASTCALL, "Return whether a capsule is more than a disc."},
    {"in_robot_frame", py_in_robot_frame, METH_FASTCALL, "Fill ``seen``: obstacles of the world in the frame of a robot at a pose."},
    {"integrate", py_integrate, METH_FASTCALL, "Return the pose after ``dt`` of a base that also moves to its left, m/s."},
    {"is_over", py_is_over, METH_FASTCALL, "Return whether nothing more is expected to happen."},
    {"kanayama", py_kanayama, METH_FASTCALL, "Return v_f of Eq. 6, m/s and rad/s, for gains k_x, k_y, k_γ."},
    {"kept_plan", py_kept_plan, METH_FASTCALL, "Return what is left of the plan of the twist driven last."},
    {"leads_on", py_leads_on, METH_FASTCALL, "Return whether the robot can turn to a heading at a pose, and drive on."},
    {"limit_twist", py_limit_twist, METH_FASTCALL, "Return what the robot drives when it is asked for a twist: the limits, enforced."},
    {"limits_of", py_limits_of, METH_FASTCALL, "Return :attr:`Robot.limit_vector` by name."},
    {"look_ticks", py_look_ticks, METH_FASTCALL, "Return how many ticks the horizon has."},
    {"memory_size", py_memory_size, METH_FASTCALL, "Return how many numbers of memory a step among so many contacts needs."},
    {"most_arcs", py_most_arcs, METH_FASTCALL, "Return how many arcs a rollout has at most."},
    {"most_contacts", py_most_contacts, METH_FASTCALL, "Return how many contacts there can be; see :func:`feature_count`."},
    {"most_sides", py_most_sides, METH_FASTCALL, "Return how many sides there can be within so many ticks."},
    {"moved_on", py_moved_on, METH_FASTCALL, "Return where a constant twist leads from a frame: :func:`arc`, by two sines."},
    {"nearest", py_nearest, METH_FASTCALL, "Return the room of a pose, m, and the speed of what is nearest, m/s."},
    {"nearest_distance", py_nearest_distance, METH_FASTCALL, "Return the distance in the row of the nearest contact, m; ∞ where it is −1."},
    {"nearest_point", py_nearest_point, METH_FASTCALL, "Return the point that all half-planes share nearest to (z_1, z_2)."},
    {"note_arrival", py_note_arrival, METH_FASTCALL, "Write the errors at the goal, and since when they have been small enough."},
    {"point_contact", py_point_contact, METH_FASTCALL, "Return the contact of a convex footprint with the point (x, y)."},
    {"prepare", py_prepare, METH_FASTCALL, "Look round and ahead, and write the QP; invalid data leave ``state`` as it is."},
    {"relaxation", py_relaxation, METH_FASTCALL, "Return by how much rows are lowered, m/s, if they need ``slack``: a little more."},
    {"repulsion_step", py_repulsion_step, METH_FASTCALL, "Return the outcome of Eq. 5 or Eq. 7."},
    {"room_on_the_way", py_room_on_the_way, METH_FASTCALL, "Return what :func:`room_round` does, the least along the arc of a control step."},
    {"room_round", py_room_round, METH_FASTCALL, "Return the least distance, and the least distance less r_min(v_o), at a pose, m."},
    {"row_at", py_row_at, METH_FASTCALL, "Return the reference at a place of a plan, linear between rows."},
    {"safety_radius", py_safety_radius, METH_FASTCALL, "Return r_min for an obstacle's speed in m/s, in m: linear between two speeds."},
    {"search_size", py_search_size, METH_FASTCALL, "Return how many numbers of memory a search needs."},
    {"set_driven", py_set_driven, METH_FASTCALL, "Let (v, ω) be what has been driven up to now."},
    {"solve_exactly", py_solve_exactly, METH_FASTCALL, "Return the twist nearest to the desired one that keeps every row and limit."},
    {"stopping_time", py_stopping_time, METH_FASTCALL, "Return τ(u) in s: driving (v, ω) so long leads to where braking would end."},
    {"track_step", py_track_step, METH_FASTCALL, "Return the desired (v, ω) of one control step, and the mode to go on with."},
    {"tracking_error", py_tracking_error, METH_FASTCALL, "Return e = R(γ)ᵀ(x_r − x) in m, robot frame, and e_γ in (−π, π] rad."},
    {"trust_box", py_trust_box, METH_FASTCALL, "Return the limits of an attempt: a box about the anchor, within the limits."},
    {"twist_box", py_twist_box, METH_FASTCALL, "Return the twists that can follow (v, ω) in dt."},
    {"unsolved", py_unsolved, METH_FASTCALL, "Return the outcome of a step that could not be taken, or not yet."},
    {"waiting_reference", py_waiting_reference, METH_FASTCALL, "Return the reference for a robot, with ρ v_r and ρ ω_r for its twist; and ρ."},
    {"wanted_distance", py_wanted_distance, METH_FASTCALL, "Return r_min(v_o), and the same with the widening of the margins, in m."},
    {"wrap_angle", py_wrap_angle, METH_FASTCALL, "Return the angle in (−π, π] that differs from ``angle`` by whole turns."},
    {"bind", bind, METH_FASTCALL, "Return the call of an entry of which most is known."},
    {NULL, NULL, 0, NULL}};

static PyModuleDef module = {
    1, NULL, NULL, 0, NULL, "_native", "Machine code of qpavoid.", -1, methods, NULL, NULL,
    NULL, NULL};

#if defined(__GNUC__)
__attribute__((visibility("default")))
#endif
PyObject *PyInit__native(void);

PyObject *PyInit__native(void)
{
    PyObject *native = PyModule_Create2(&module, ABI);
    new_tuple = (newfunc)PyType_GetSlot(&PyTuple_Type, TP_NEW);
    if (native && PyModule_AddStringConstant(native, "STAMPS", "qpavoid.avoidance.barrier_rows e3bc00eeaccc6a749630a45c0fdbd463b978d69185f50f4125bec23c74275441\nqpavoid.avoidance.ladder c9b5be2bde05034c8dd23ecdbe63243b4df953238f723e6be2131331e0c07a5c\nqpavoid.avoidance.lanes ab72c60ae7a55394199a707f3f6a0979b296dd23accfa545bbf9a8b7e70c5841\nqpavoid.avoidance.linearisation 761fcddba4ca728b12e1157c8290861e9bbd26dc93423bee5315946d8ee84495\nqpavoid.avoidance.prediction c1c930e492720b4519a6b2dd07354d228f00cf9d97f24bb9851862c0450b0520\nqpavoid.avoidance.repulsion 2abd03e8491158af233e2f1c76a73f79959a5e9f53c380a1d77e2b12a5d22e80\nqpavoid.avoidance.settings 43266c1f9a9f0d0117674667c313307c44c56339a1e84a913f00c544c7cf2d23\nqpavoid.avoidance.state 407ebe5aa40fba436987406c5eb36420fd9847afe8cdfa517dc79a15396a2f38\nqpavoid.avoidance.step b548315aaf97264361cbb0582fc7ea085563013c177313d08c68a68f212fd726\nqpavoid.avoidance.workspace d2465ca6e33d5025d40f6cb71da87bc1f667462decb54f5054a35a381507f1d8\nqpavoid.guide.rollout 3f15d2011656b9591bb39bcaf7a4ad5da276e4dc602d168c7c6d6337143ce197\nqpavoid.guide.stage 5c65f3307a578c0ce2d587a6dcb03c861f0a9913bd0d4482d18571b9ce1d48d9\nqpavoid.guide.way a37f22bbcb21146da120559266298d72daafa190e6c531a60884419aeacedf61\nqpavoid.lab.simulation.clearance 007a0fa3eff135f05c5f2cebc61d4e6bbe508a135fb47c9909d692e125c6997b\nqpavoid.lab.simulation.loop 7cd424da8dc959bc257f651216470ffe500ccfb583428cb3492c70b4892c92b9\nqpavoid.lab.simulation.outcome 7d3e1a2c8fc6ad078ebae4dd12eee271e038a0aeac1c6297f6747c0a93964f0d\nqpavoid.model.capsules 14766613e6b04603631cd098916564d7f9c77853098d46e5f554ae1d50b73098\nqpavoid.model.contact af9c29a4db715852095a61cf95654100c4e76fc01604840da43bc7107f28026e\nqpavoid.model.contacts 3824caed8534e5cb8960fd9c29d27142fd14bc0cdedc43f1c321893a0084477d\nqpavoid.model.kinematics 6259f6c24c8a28072edd60831ac69f36d94e504e05f0caec79768f3ceccb9868\nqpavoid.model.robot d4430349ba6d145f8c7f3331cf93e2386a3681ef68643651303615183fb852b2\nqpavoid.qp.exact 709c8ae6f356dbf2fc6e92b9e6c1272a729e1e3d359805cd47974bed6de29b2a\nqpavoid.tracking.clock a0ce5f866b6d9389264bfadc0ebc607ce7d1bae3da11cf0eccf4cce02d5b1d3e\nqpavoid.tracking.kanayama 3c1c81a334305f528a72f3be1584effd839162b0cd70b7daff204d1f3593ade8\nqpavoid.tracking.station e1d8da4beef2eacac82d86b86b93db36d07a5f21a1c9f077f055674bde32fdd8\n"))
        return NULL;
    return native;
}
