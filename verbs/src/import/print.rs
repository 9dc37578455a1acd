//! The report of an import as text.

use core::fmt;

use super::Report;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "frames          {} in {:.3} s at {} Hz, {} rows skipped",
            self.frames, self.duration_s, self.frame_rate_hz, self.rows_skipped
        )?;
        writeln!(f, "unit of length  {} m", self.unit_m)?;
        let (own, with): (Vec<_>, Vec<_>) =
            (self.segments.iter()).partition(|mapped| mapped.source.is_some());
        let named = own.iter().filter_map(|mapped| {
            let source = mapped.source.as_deref()?;
            let deviation = mapped.deviation_deg;
            let deviation = deviation.map_or(String::new(), |deg| format!(" ({deg:.1} deg)"));
            Some(if mapped.segment == source {
                format!("{source}{deviation}")
            } else {
                format!("{} = {source}{deviation}", mapped.segment)
            })
        });
        writeln!(
            f,
            "segments        {}",
            named.collect::<Vec<_>>().join(", ")
        )?;
        if !with.is_empty() {
            let names: Vec<&str> = with.iter().map(|mapped| mapped.segment).collect();
            writeln!(
                f,
                "missing         {}: they move with their neighbours",
                names.join(", ")
            )?;
        }
        for warning in &self.warnings {
            writeln!(f, "warning         {warning}")?;
        }
        writeln!(f, "verdict         {}", self.verdict)?;
        writeln!(
            f,
            "first frame     from the front, and from the left; R is the right hand ({})\n{}",
            self.picture.display(),
            self.letters
        )?;
        write!(f, "written         {}", self.flight.display())
    }
}
