//! Who belongs to whom: the assignment of rows to columns with the least sum of costs.

/// For every row its column, no column twice, so that the sum of `cost(row, column)` is least. There must be no fewer columns
/// than rows, and every cost finite.
///
/// Shortest augmenting paths with potentials (Kuhn 1955, Munkres 1957; in this form Jonker and Volgenant 1987), of order
/// rows^2 x columns.
pub fn assign(rows: usize, columns: usize, cost: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    assert!(rows <= columns, "{rows} rows do not fit into {columns} columns");
    // columns and rows are counted from 1; 0 is where a path starts
    let (mut of_row, mut of_column) = (vec![0.0; rows + 1], vec![0.0; columns + 1]);
    let mut row_in = vec![0; columns + 1];
    for row in 1..=rows {
        row_in[0] = row;
        let mut least = vec![f64::INFINITY; columns + 1];
        let mut before = vec![0; columns + 1];
        let mut done = vec![false; columns + 1];
        let mut at = 0;
        while row_in[at] != 0 {
            done[at] = true;
            let (mut next, mut step) = (0, f64::INFINITY);
            for column in (1..=columns).filter(|column| !done[*column]) {
                let reduced = cost(row_in[at] - 1, column - 1) - of_row[row_in[at]] - of_column[column];
                if reduced < least[column] {
                    (least[column], before[column]) = (reduced, at);
                }
                if least[column] < step {
                    (step, next) = (least[column], column);
                }
            }
            for column in 0..=columns {
                if done[column] {
                    of_row[row_in[column]] += step;
                    of_column[column] -= step;
                } else {
                    least[column] -= step;
                }
            }
            at = next;
        }
        while at != 0 {
            row_in[at] = row_in[before[at]];
            at = before[at];
        }
    }
    let mut columns_of = vec![0; rows];
    for (column, row) in row_in.iter().enumerate().skip(1).filter(|(_, row)| **row != 0) {
        columns_of[row - 1] = column - 1;
    }
    columns_of
}

#[cfg(test)]
mod tests {
    use super::assign;

    /// Against all permutations.
    #[test]
    fn no_other_assignment_costs_less() {
        let mut seed = 3_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        for (rows, columns) in [(1, 1), (3, 3), (4, 6), (5, 5)] {
            for _ in 0..20 {
                let costs: Vec<Vec<f64>> = (0..rows).map(|_| (0..columns).map(|_| random()).collect()).collect();
                let found = assign(rows, columns, |i, j| costs[i][j]);
                let sum: f64 = found.iter().enumerate().map(|(i, j)| costs[i][*j]).sum();
                assert!((sum - cheapest(&costs, 0, &mut vec![false; columns])).abs() < 1e-12, "{costs:?} {found:?}");
            }
        }
    }

    fn cheapest(costs: &[Vec<f64>], row: usize, taken: &mut Vec<bool>) -> f64 {
        if row == costs.len() {
            return 0.0;
        }
        let mut best = f64::INFINITY;
        for column in 0..taken.len() {
            if !taken[column] {
                taken[column] = true;
                best = best.min(costs[row][column] + cheapest(costs, row + 1, taken));
                taken[column] = false;
            }
        }
        best
    }
}
