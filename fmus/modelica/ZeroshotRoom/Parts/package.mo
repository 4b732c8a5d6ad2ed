within ZeroshotRoom;
package Parts "Walls, window and controller whose parameters act at run time"

end Parts;
