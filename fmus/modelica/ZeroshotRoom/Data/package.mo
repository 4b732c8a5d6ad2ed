within ZeroshotRoom;
package Data "Plain records whose fields keep their names in the FMU"

  annotation (Documentation(info="<html>
<p>A field of these records has a literal default and no <code>Evaluate</code>. Tools therefore leave it a parameter that can
be set after compilation. Fields of the library's material and glazing records are evaluated when they are compiled, and
an FMU then accepts new values without a word and ignores them.</p>
</html>"));
end Data;
