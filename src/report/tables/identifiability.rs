//! What the markers tell: `identifiability.csv`, `combinations.csv`, `pairs.csv` and `unexplained.csv`.

use super::{Cell, Rows, Table, components, of_frame};
use crate::error::Result;
use crate::fit::covariance::Bound;
use crate::fit::identifiability::{Combination, Told};
use crate::report::frame::Frame;
use crate::report::run_folder::RunFolder;

/// The four tables.
#[derive(Debug)]
pub struct IdentifiabilityTables {
    controls: Table,
    combinations: Table,
    pairs: Table,
    unexplained: Table,
}

impl IdentifiabilityTables {
    /// New tables.
    ///
    /// - `identifiability.csv`: of every control that is sought its value, standard deviation (empty on a bound, or where the
    ///   markers do not determine it), 95 % interval, bound, where it would go without its bound, the standard deviation
    ///   without any marker, whether the markers take less than half of that variance away, the bias by the mesh (with
    ///   `--estimate`), and whether the frame had failed and is bridged by smoothness.
    /// - `combinations.csv`: singular values of the weighted derivative with controls in parts of their ranges; rows without
    ///   a frame are those of the whole clip.
    /// - `pairs.csv`: pairs whose errors correlate by more than 0.9: what is determined is `together` = a + weight b.
    /// - `unexplained.csv`: of every marker the residual with the best admissible controls to first order, and the length
    ///   that noise alone would leave.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), here and below.
    pub fn create(run: &RunFolder) -> Result<IdentifiabilityTables> {
        let table = |name: &str, columns: &str| Table::create(&run.tables(), name, columns.split(','));
        Ok(IdentifiabilityTables {
            controls: table(
                "identifiability",
                "frame,time_s,control,value,sd,lower_95,upper_95,bound,wants,prior_sd,prior_dominated,bias,bridged",
            )?,
            combinations: table("combinations", "frame,time_s,number,singular_value,sd,determined,combination")?,
            pairs: table(
                "pairs",
                "frame,time_s,a,b,correlation,weight,together,together_sd,a_sd,b_sd,prior_dominated",
            )?,
            unexplained: table(
                "unexplained",
                "frame,time_s,marker,left_x_mm,left_y_mm,left_z_mm,left_mm,expected_mm",
            )?,
        })
    }

    /// Adds a frame; `names` are those of all controls of the model and of all markers, `biases` one per control of `told` or
    /// none.
    pub fn add(
        &mut self,
        frame: Frame,
        told: &Told,
        (controls, markers): (&[String], &[String]),
        biases: &[Option<f64>],
    ) -> Result<()> {
        let [index, time] = of_frame(frame);
        let mut rows = Rows::default();
        for (k, known) in told.controls.iter().enumerate() {
            let bound = match known.bound {
                Bound::Free => "free",
                Bound::Lower => "lower",
                Bound::Upper => "upper",
            };
            rows.add([
                index,
                time,
                Cell::Text(&controls[known.control]),
                known.value.into(),
                known.sd.into(),
                known.interval[0].into(),
                known.interval[1].into(),
                bound.into(),
                known.wants.into(),
                known.prior_sd.into(),
                usize::from(known.prior_dominated).into(),
                biases.get(k).copied().flatten().into(),
                usize::from(told.bridged).into(),
            ]);
        }
        self.controls.append(rows)?;
        self.combine([index, time], &told.combinations, controls)?;
        let mut rows = Rows::default();
        for pair in &told.pairs {
            let [a, b] = pair.controls.map(|k| Cell::Text(&controls[k]));
            let numbers =
                [pair.correlation, pair.weight, pair.together, pair.together_sd, pair.apart_sd[0], pair.apart_sd[1]];
            let numbers = numbers.map(Cell::Number);
            let dominated = Cell::Count(pair.prior_dominated.into());
            rows.add([index, time, a, b].into_iter().chain(numbers).chain([dominated]));
        }
        self.pairs.append(rows)?;
        let mut rows = Rows::default();
        for left in &told.unexplained {
            let name = Cell::Text(&markers[left.marker]);
            let cells = [index, time, name].into_iter().chain(components(left.left_mm));
            rows.add(cells.chain([left.distance_mm().into(), left.expected_mm.into()]));
        }
        self.unexplained.append(rows)
    }

    /// Adds the combinations of the whole clip.
    pub fn clip(&mut self, combinations: &[Combination], controls: &[String]) -> Result<()> {
        self.combine([Cell::Empty; 2], combinations, controls)
    }

    fn combine(&mut self, frame: [Cell<'_>; 2], all: &[Combination], controls: &[String]) -> Result<()> {
        let mut rows = Rows::default();
        for (number, combination) in all.iter().enumerate() {
            let words = combination.words(controls);
            let determined = usize::from(combination.is_determined());
            let numbers = [number.into(), combination.singular.into(), combination.sd().into(), determined.into()];
            rows.add(frame.into_iter().chain(numbers).chain([Cell::Text(&words)]));
        }
        self.combinations.append(rows)
    }
}

/// `advice.csv`: markers to add, the best first, each with a row per control: `number,x_mm,y_mm,z_mm,gain,control,sd_before,sd_after`.
pub fn advice_table<'a>(
    markers: impl Iterator<Item = ([f64; 3], f64, &'a [(usize, f64, f64)])>,
    controls: &[&str],
) -> String {
    let mut rows = Rows { text: "number,x_mm,y_mm,z_mm,gain,control,sd_before,sd_after\n".into() };
    for (number, (place, gain, effects)) in markers.enumerate() {
        for (control, before, after) in effects {
            let cells = [Cell::Count(number + 1)].into_iter().chain(components(place));
            let name = Cell::Text(controls[*control]);
            rows.add(cells.chain([gain.into(), name, (*before).into(), (*after).into()]));
        }
    }
    rows.text
}
