//! Reduces curves to what is drawn: parts between jumps, and no more points than the figure can show.

/// Reduces a curve to the lowest and highest point within each `width`, and the last point.
pub(super) fn thinned(points: &[(f64, f64)], width: f64) -> Vec<(f64, f64)> {
    let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
    let same = |a: &(f64, f64), b: &(f64, f64)| (a.0 / width).floor() >= (b.0 / width).floor();
    let mut shown: Vec<(f64, f64)> = Vec::new();
    for column in points.chunk_by(same) {
        let ends = (
            column.iter().min_by(by_value),
            column.iter().max_by(by_value),
        );
        if let (Some(low), Some(high)) = ends {
            let (first, second) = if low.0 < high.0 {
                (low, high)
            } else {
                (high, low)
            };
            shown.extend([first, second]);
        }
    }
    shown.extend(points.last());
    shown.dedup();
    shown
}

/// Half the jump of an angle (degrees).
const HALF_TURN: f64 = 180.0;

/// Splits a curve where its angle jumps between the ends of its range.
pub(super) fn unwrapped_parts(wraps: bool, points: &[(f64, f64)]) -> Vec<&[(f64, f64)]> {
    let jumps = |pair: &[(f64, f64)]| match pair {
        [a, b] => wraps && (b.1 - a.1).abs() > HALF_TURN,
        _ => false,
    };
    let mut parts = Vec::new();
    let mut begin = 0;
    for (index, pair) in points.windows(2).enumerate() {
        if jumps(pair) {
            parts.extend(points.get(begin..=index));
            begin = index + 1;
        }
    }
    parts.extend(points.get(begin..));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_split_where_its_angle_wraps() {
        let points = [(0.0, 170.0), (1.0, 179.0), (2.0, -179.0), (3.0, -170.0)];
        let parts = unwrapped_parts(true, &points);
        assert_eq!(parts, [&points[..2], &points[2..]]);
        assert_eq!(unwrapped_parts(false, &points).len(), 1);
    }

    #[test]
    fn a_dense_curve_keeps_its_extremes() {
        let points: Vec<(f64, f64)> = (0..1000)
            .map(|k| (f64::from(k) * 0.001, if k == 357 { 5.0 } else { 0.0 }))
            .collect();
        let shown = thinned(&points, 0.1);
        assert!(shown.len() < 50 && shown.contains(&(0.357, 5.0)));
        assert_eq!(
            (shown.first(), shown.last()),
            (points.first(), points.last())
        );
        assert_eq!(thinned(&points, 0.0005).len(), points.len());
    }
}
