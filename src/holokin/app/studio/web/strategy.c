/* What a page calls: hk_follow along the loop that lies in this memory, and where the arm's pieces are, to draw it. */
#define PAGE(name) __attribute__((export_name(#name)))
enum { PAGE_ROWS = 64, PAGE_STATE = HK_STATE + HK_N + 1, PAGE_DRAWN = $drawn };
static hk_segment page_segments[$segments];
static long long page_counts[$segments + 1];
static double page_closing[HK_TARGET], page_state[PAGE_STATE], page_rows[PAGE_ROWS * HK_N], page_drawn[PAGE_DRAWN];
static const double page_limits[2][2][HK_N] = {{{$lower}, {$upper}}, {{$free_lower}, {$free_upper}}};

PAGE(segments) double *hk_page_segments(void) { return (double *)page_segments; }
PAGE(closing) double *hk_page_closing(void) { return page_closing; }
PAGE(state) double *hk_page_state(void) { return page_state; }
PAGE(rows) double *hk_page_rows(void) { return page_rows; }
PAGE(drawn) double *hk_page_drawn(void) { return page_drawn; }
PAGE(count) void hk_page_count(int segment, int steps) { page_counts[segment] = steps; }

/* Steps [first, last) of a cycle, PAGE_ROWS at most, from the posture in the state into the rows; returns how many were
   done. side: the sign of det [J; J_g] on the branch. free: without joint limits. */
PAGE(follow) int hk_page_follow(int first, int last, int closed, double side, int free) {
  const hk_rules rules = {$rules};
  (void)side;
  return (int)hk_follow(page_segments, page_counts, closed ? page_closing : 0, page_state, first, last,
                        page_limits[free][0], page_limits[free][1], &rules, page_rows);
}

/* The points of the pieces at the posture in the state. */
PAGE(draw) void hk_page_draw(void) { hk_drawn_body(page_state, page_drawn); }
