/* Find the value of one input at which the model gives a wanted output, by bisection between the turning points of the output. */
typedef struct {
    const real *in; /* the other inputs, and a value near which a solution is preferred */
    int which;      /* index of the input to find */
    real wanted;
} problem;

typedef real (*function)(const problem *, real);

/* Return the difference between the output at a value of the input and the wanted output. */
static real missing_at(const problem *p, real x)
{
    real in[INPUTS], out;
    for (int i = 0; i < INPUTS; i++) in[i] = i == p->which ? x : p->in[i];
    EVALUATE(in, &out);
    return out - p->wanted;
}

/* Return the same difference, and the derivative of the output. */
static real both_at(const problem *p, real x, real *slope)
{
    real in[INPUTS], out, slopes[INPUTS];
    for (int i = 0; i < INPUTS; i++) in[i] = i == p->which ? x : p->in[i];
    DIFFERENTIATE(in, &out, slopes);
    *slope = slopes[p->which];
    return out - p->wanted;
}

static real derivative_at(const problem *p, real x)
{
    real slope;
    (void)both_at(p, x, &slope);
    return slope;
}

/* Return the value at which a function changes its sign between two values. */
static real bisected(function f, const problem *p, real low, real high)
{
    const real start = sign_of(f(p, low));
    for (int i = 0; i < BISECTIONS; i++) {
        const real middle = (low + high) / 2;
        if (sign_of(f(p, middle)) == start)
            low = middle;
        else
            high = middle;
    }
    return (low + high) / 2;
}

/* Return 1 if the function may have two turning points and a zero in a part: an end is far steeper than the secant, and could reach zero. */
static int may_turn_twice(real left, real right, real slope_left, real slope_right, real width)
{
    const real reach = FMAX(FABS(slope_left), FABS(slope_right)) * width, rise = right - left;
    if (!(reach > STEEP * FABS(rise) || rise * (slope_left + slope_right) < 0)) return 0;
    return reach > SAME * FMAX(FABS(left), FABS(right)) && FMIN(FABS(left), FABS(right)) <= reach;
}

/* Append the turning points within a part to the n edges, and return the new number of edges. A part that may have more is divided. */
static int turning_points(const problem *p, real low, real high, int splits, int *room, real *edges, int n)
{
    const real start = NEXT(low, INFINITY), end = NEXT(high, -INFINITY);
    real slope_left, slope_right, middle = (low + high) / 2;
    const real left = both_at(p, start, &slope_left), right = both_at(p, end, &slope_right);
    const int turned = sign_of(slope_left) * sign_of(slope_right) < 0;
    int closer;
    if (turned) {
        real value;
        middle = bisected(derivative_at, p, start, end);
        value = missing_at(p, middle);
        closer = may_turn_twice(left, value, slope_left, 0, middle - low) || may_turn_twice(value, right, 0, slope_right, high - middle);
    } else {
        closer = may_turn_twice(left, right, slope_left, slope_right, high - low);
    }
    closer = closer && splits > 0 && *room > 0;
    if (closer) {
        --*room;
        n = turning_points(p, low, middle, splits - 1, room, edges, n);
    }
    if (closer || turned) edges[n++] = middle;
    if (closer) n = turning_points(p, middle, high, splits - 1, room, edges, n);
    return n;
}

/* Find the ends of the monotone parts in ascending order, and the differences there. Each interval between knots is searched in equal parts. */
static int scanned(const problem *p, int count, const real *knots, int parts, real *edges, real *missing)
{
    int n = 0, room = DIVIDED;
    for (int i = 0; i < count - 1; i++) {
        const real step = (knots[i + 1] - knots[i]) / (real)parts;
        for (int j = 0; j < parts; j++) {
            const real start = (real)j * step + knots[i];
            const real end = j < parts - 1 ? (real)(j + 1) * step + knots[i] : knots[i + 1];
            edges[n++] = start;
            if (j == 0) edges[n++] = NEXT(start, INFINITY); /* the output may jump at a knot */
            n = turning_points(p, start, end, SPLITS, &room, edges, n);
        }
        edges[n++] = NEXT(knots[i + 1], -INFINITY);
    }
    edges[n++] = knots[count - 1];
    for (int i = 0; i < n; i++) missing[i] = missing_at(p, edges[i]);
    return n;
}

/* Return the largest difference that counts as zero, a fraction of the range of outputs; negative if an output is not finite. */
static real equal_within(const problem *p, int n, const real *missing)
{
    real low = INFINITY, high = -INFINITY;
    for (int i = 0; i < n; i++) {
        if (!isfinite(missing[i])) return -1;
        low = FMIN(low, missing[i]);
        high = FMAX(high, missing[i]);
    }
    return SAME * FMAX(high - low, FABS(p->wanted));
}

/* Count a solution, and keep it if it is the first or nearer to the preferred value than the one before. */
static void found_one(const problem *p, real x, int *count, real *picked)
{
    const real near = p->in[p->which];
    if (*count == 0 || FABS(x - near) < FABS(*picked - near)) *picked = x;
    ++*count;
}

static int solved(const problem *p, int count, const real *knots, int parts, real *found)
{
    real edges[PLACES], missing[PLACES];
    const int n = scanned(p, count, knots, parts, edges, missing);
    const real within = equal_within(p, n, missing);
    int solutions = 0, flat = 0, before = 0;
    *found = NAN;
    if (within < 0 || !isfinite(p->wanted)) return NONE;
    for (int i = 0; i < n; i++) {
        const int hit = FABS(missing[i]) <= within;
        if (i > 0 && hit && before && edges[i] - edges[i - 1] > SAME * (knots[count - 1] - knots[0])) flat = 1;
        if (i > 0 && !hit && !before && sign_of(missing[i - 1]) * sign_of(missing[i]) < 0 && edges[i] > edges[i - 1]) {
            const real x = bisected(missing_at, p, edges[i - 1], edges[i]);
            /* a jump of the output across the wanted value is no solution */
            if (FABS(missing_at(p, x)) <= FMAX(REACHED * FABS(p->wanted), within)) found_one(p, x, &solutions, found);
        }
        if (hit && !before) found_one(p, edges[i], &solutions, found);
        before = hit;
    }
    return flat ? FLAT : solutions > 1 ? SEVERAL : solutions;
}
